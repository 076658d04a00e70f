"""Results of decompositions, scene by scene, and their summaries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.evaluation.sets.measures import OTHERS, SCORES
from scenefw.evaluation.sets.published import ROWS
from scenefw.evaluation.statistics import mean_interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Camera, Float32, GridSpec

_PUBLISHED = ("cross_entropy", "missing_or_joined", "duplicate_or_split")


@dataclass(frozen=True)
class SceneCodes:
    """Codes of one scene (figs 6.8 and 6.9).

    Args:
        features: (C, S^3) of all cells.
        cells: (N,) positions that codes were taken from.
        exists: (N,) bool, whether an object came of it.
        codes: (N, C), as they are decoded.
    """

    features: Float32
    cells: NDArray[np.int64]
    exists: NDArray[np.bool_]
    codes: Float32

    @property
    def means(self) -> Float32:
        """Channel mean (S^3,) of each cell."""
        return self.features.mean(axis=0)


@dataclass(frozen=True)
class DecomposedScene:
    """A test scene and what each method makes of it.

    Args:
        scene: number of the scene in its data set.
        objects: how many it has.
        scores: by method and name.
        codes: of the main method, or None.
        hidden: objects of which the view shows little or nothing.
    """

    scene: int
    objects: int
    scores: Mapping[str, Mapping[str, float]]
    codes: SceneCodes | None = None
    hidden: int = 0


@dataclass(frozen=True)
class SetExample:
    """A scene to draw.

    Args:
        scene: number of the scene in its data set.
        grid: of the labels.
        camera: that saw it.
        depth: (H, W) z-depth (m).
        labels: (X, Y, Z) int64 of the truth and of methods, by name; 0 = no object.
    """

    scene: int
    grid: GridSpec
    camera: Camera
    depth: Float32
    labels: Mapping[str, NDArray[np.int64]]


@dataclass(frozen=True)
class DecompositionResult:
    """What was found on all scenes.

    Args:
        scenes: in their order.
        methods: names, the main one first, then the strongest that learns nothing.
        published: key of `published.ROWS`, or None.
        examples: to draw.
    """

    scenes: tuple[DecomposedScene, ...]
    methods: tuple[str, ...]
    published: str | None = None
    examples: tuple[SetExample, ...] = ()

    def of(self, method: str, name: str) -> NDArray[np.float64]:
        """A score of each scene; NaN where the method has none."""
        return np.array([scene.scores[method].get(name, np.nan) for scene in self.scenes])

    @property
    def figures(self) -> dict[str, float]:
        """Means over scenes, with bounds of the main method; of others as `<method>/<name>`."""
        figures: dict[str, float] = {}
        for method in self.methods:
            main = method == self.methods[0]
            for name in SCORES:
                between = mean_interval(self.of(method, name))
                if not between.count:
                    continue
                figures[name if main else f"{method}/{name}"] = between.mean
                if main and between.count > 1:
                    figures |= {name + LOW: between.low, name + HIGH: between.high}
        counts = [scene.objects for scene in self.scenes]
        figures |= {"scenes": float(len(counts)), "objects": float(np.mean(counts))}
        figures["hardly_seen"] = float(np.mean([scene.hidden > 0 for scene in self.scenes]))
        return figures | self._of_codes()

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits, what the strongest reference reaches, and the thesis's figures."""
        row = ROWS[self.published]._asdict() if self.published else {}
        measures = {}
        for method in self.methods:
            for name, measure in SCORES.items():
                if method == self.methods[0]:
                    beside = f"{self.methods[1]}/{name}" if len(self.methods) > 1 else None
                    published = row.get(name) if name in _PUBLISHED else None
                    measures[name] = measure.changed({"trivial": beside, "published": published})
                else:
                    words = f"{measure.name}, {method.replace('_', ' ')}"
                    measures[f"{method}/{name}"] = measure.changed({"name": words})
        return measures | OTHERS

    def _of_codes(self) -> dict[str, float]:
        """How far taken cells stand out, and how many different ones are taken."""
        codes = [scene.codes for scene in self.scenes if scene.codes is not None]
        if not codes:
            return {}
        gaps = []
        for scene_codes in codes:
            cell_mask = np.zeros(len(scene_codes.means), bool)
            cell_mask[scene_codes.cells] = True
            gaps.append(scene_codes.means[cell_mask].mean() - scene_codes.means[~cell_mask].mean())
        used_cells = np.unique(
            np.concatenate([scene_codes.cells[scene_codes.exists] for scene_codes in codes])
        )
        return {"mean_gap": float(np.mean(gaps)), "cells_used": float(len(used_cells))}
