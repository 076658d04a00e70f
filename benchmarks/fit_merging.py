"""Fits the log odds that two regions are one object: python -m benchmarks.fit_merging MESHES.

Household things of the validation family, simulated as each sensor sees them, as in
`experiment=household split=val`; MESHES is its input. Prints the settings of
`segmentation.merging`, and how many pairs they and the network alone have wrong in images that
they were not fitted to.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold, cross_val_predict

from scenefw import config, plugins
from scenefw.core.errors import InputError
from scenefw.execution.build import Builder
from scenefw.perception.segmentation.region_merging import RegionPairs
from scenefw_single_view_benchmarks.true_things import TrueThings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Float64, Int32
    from scenefw.perception.steps import Segmentation

MODEL = LogisticRegression(C=np.inf)  # no penalty: thousands of pairs, four numbers
_NAMES = ("affinity", "same_part", "log_pixels")
_MIN_BORDER = 3  # pixels of a border that say something
_MIN_PURITY = 0.7  # of a region's pixels that show one object, or none: others are both
_FOLDS = 5


@dataclass
class PairRecorder:
    """Stands in for `RegionMerging`: keeps what it is asked, and joins nothing."""

    creases: Segmentation
    regions: Int32 | None = None
    pairs: RegionPairs | None = None

    def merged(self, regions: Int32, across: Float32, down: Float32, parts: Int32) -> Int32:
        """The regions themselves."""
        self.regions, self.pairs = regions, RegionPairs.of(regions, across, down, parts)
        return regions


def labelled_pairs(recorder: PairRecorder, labels: Int32) -> tuple[Float64, NDArray[np.bool_]]:
    """Measures (N, 3) of an image's pairs, and whether they are one object (N)."""
    regions, pairs = recorder.regions, recorder.pairs
    assert regions is not None
    assert pairs is not None
    step = round(labels.shape[1] / regions.shape[1])
    counts = np.zeros((len(pairs.borders), labels.max() + 2))
    np.add.at(counts, (regions, labels[::step, ::step] + 1), 1)
    owner = counts.argmax(axis=1) - 1
    is_clear = (owner > 0) & (counts.max(axis=1) > _MIN_PURITY * counts.sum(axis=1))
    first, second = np.nonzero(np.triu(pairs.borders >= _MIN_BORDER))
    keep = is_clear[first] & is_clear[second]
    first, second = first[keep], second[keep]
    return pairs.measures()[first, second], owner[first] == owner[second]


def wrong_ratio(measures: Float64, is_same: NDArray[np.bool_], scenes: NDArray[np.intp]) -> float:
    """Of pairs, as said by a model that was fitted to other scenes."""
    answers = cross_val_predict(MODEL, measures, is_same, groups=scenes, cv=GroupKFold(_FOLDS))
    return float((answers != is_same).mean())


def main() -> None:
    """Fits and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes")
    parser.add_argument("--scenes", type=int, default=10, help="of each of the two strata")
    options = parser.parse_args()
    plugins.activate()
    settings = ["experiment=household", f"input={options.meshes}", "split=val", "device=cpu"]
    builder = Builder(config.compose([*settings, f"size.test_scenes={options.scenes}"]))
    pipeline = builder.build("evaluation.methods.set_extents")
    recorder = PairRecorder(pipeline.segmentation.merging.creases)
    object.__setattr__(pipeline.segmentation, "merging", recorder)
    rows, answers, images = [], [], []
    for sensors in builder.build("evaluation.strata").values():
        for scenes in sensors.values():
            for scene in range(len(scenes)):
                (view,) = scenes.views(scene, 1)
                try:
                    pipeline.segmentation.segment(pipeline.observe(view.frame))
                except InputError:
                    continue  # as the benchmark counts it: refused
                labels = TrueThings.of(view, min_pixels=100, voxel=0.006).labels
                measures, is_same = labelled_pairs(recorder, labels)
                rows.append(measures)
                answers.append(is_same)
                images.append(np.full(len(is_same), scene))
    measures, is_same = np.concatenate(rows), np.concatenate(answers)
    numbers = np.concatenate(images)
    print(f"# {len(is_same)} pairs of {len(rows)} images, {is_same.mean():.0%} one object;")
    print(f"# wrong in images that were held out: {wrong_ratio(measures, is_same, numbers):.1%},")
    print(f"# by the network alone {wrong_ratio(measures[:, :1], is_same, numbers):.1%}")
    model = MODEL.fit(measures, is_same)
    print(f"intercept: {model.intercept_[0]:.2f}")
    for name, value in zip(_NAMES, model.coef_[0], strict=True):
        print(f"{name}: {value:.2f}")


if __name__ == "__main__":
    main()
