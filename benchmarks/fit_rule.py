"""Fits the questions of label_source=by_rule to true maps: python -m benchmarks.fit_rule.

Prints the mean IoU on validation tables for trees of several sizes, and the best one as YAML.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from scenefw import registry
from scenefw.metrics.semantic import class_ious, count_classes, mean_iou
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_labelling_studies.components import FEATURES, Row, answers, components, fitted
from scenefw_tabletops.data.table_scenes import TabletopScenes

Case = tuple[NDArray, NDArray, NDArray]


def cases(split: str, count: int, level: float) -> tuple[list[Case], tuple[str, ...]]:
    """Components, features and labels of true maps."""
    source: TabletopScenes = registry.build(
        "dataset", "tabletop", split=split, limit=count, cache=None
    )
    source.renderer = MeshRaycaster(contrast=1.0)  # colour does not matter
    found = []
    for scene in range(len(source)):
        truth = source.truth(scene)
        if truth.labels is not None:
            parts = components(truth.heights, level, truth.grid.spacing)
            found.append((*parts, truth.labels))
    return found, source.classes


def amounts(made: list[Case], classes: int) -> NDArray[np.float64]:
    """Vertices of each class in each component (N, C)."""
    every = []
    for number, features, labels in made:
        count = np.zeros((len(features) + 1, classes))
        np.add.at(count, (number.ravel(), labels.ravel()), 1)
        every.append(count[1:])
    return np.concatenate(every)


def score(rows: list[Row], made: list[Case], classes: tuple[str, ...]) -> NDArray[np.int64]:
    """Confusion counts of a tree."""
    total = np.zeros((len(classes), len(classes) + 1), dtype=np.int64)
    for number, features, labels in made:
        given = [0, *(classes.index(name) for name in answers(features, rows))]
        total += count_classes(np.array(given)[number], labels, len(classes))
    return total


def main() -> None:
    """Fits and prints."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tables", type=int, default=60)
    parser.add_argument("--validation-tables", type=int, default=12)
    parser.add_argument("--level", type=float, default=0.0004)
    words = parser.parse_args()
    train, classes = cases("train", words.tables, words.level)
    held, _ = cases("validation", words.validation_tables, words.level)
    known = np.concatenate([features for _, features, _ in train])
    counts = amounts(train, len(classes))
    best: tuple[float, list[Row]] = (0.0, [])
    for power in (0.0, 0.5, 0.8, 1.0):  # how much rare classes gain
        weights = counts / np.maximum(counts.sum(axis=0), 1) ** power
        for leaves in (6, 10, 16, 24, 40):
            rows = fitted(known, weights, classes, leaves)
            found = score(rows, held, classes)
            mean = float(mean_iou(found))
            print(f"power {power} leaves {leaves}: {mean:.3f}", class_ious(found).round(2))
            best = max(best, (mean, rows), key=lambda one: one[0])
    print(f"# {best[0]:.3f} on {len(held)} validation tables; features: {', '.join(FEATURES)}")
    print("tree:")
    for row in best[1]:
        print(f"  - [{', '.join(map(str, row))}]")


if __name__ == "__main__":
    main()
