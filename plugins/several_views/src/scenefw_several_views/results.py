"""Errors against the number of views, and their summaries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.core.types import Float64
from scenefw.evaluation.stacks.methods import described
from scenefw.evaluation.statistics import Interval, bootstrap_interval

SCORES = {
    "chamfer_full": Measure(
        "Chamfer, 1000 points", "Chamfer distance of 1000 points", "mm", 1, "lower", 1000.0
    ),
    "excess": Measure("excess", "dense Chamfer distance over its floor", "mm", 1, "lower", 1000.0),
    "fscore_1cm": Measure("F, 1 cm", "F-score at 1 cm", "", 3, "higher"),
    "occupancy_iou": Measure("occupancy IoU", "", "", 3, "higher"),
    "instance_iou": Measure("instance IoU", "", "", 3, "higher"),
    "count_error": Measure("count error", "error of the number of objects", "", 2, "lower"),
}
FLOOR = "floor"
"""Name of the figure of the Chamfer distance that no method falls below."""
_NUMBERS = {
    "scenes": Measure("scenes", digits=0),
    "samples": Measure("samples", "samples per scene at most", digits=0),
}


@dataclass(frozen=True)
class SceneScores:
    """Scores of one scene.

    Args:
        scene: number in its data set.
        floor: Chamfer distance of 1000 points of the truth, drawn twice (m).
        scores: by method, number of views and name; means over samples.
    """

    scene: int
    floor: float
    scores: Mapping[str, Mapping[int, Mapping[str, float]]]

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> SceneScores:
        """What `dataclasses.asdict` and JSON, which knows only text as keys, made rows of."""
        scores = {
            method: {int(count): scores for count, scores in counts.items()}
            for method, counts in row["scores"].items()
        }
        return cls(row["scene"], row["floor"], scores)


@dataclass(frozen=True)
class SeveralViewsResult:
    """Scores of every scene.

    Args:
        scenes: with their scores.
        methods: names.
        counts: numbers of views.
        samples: per scene at most.
    """

    scenes: tuple[SceneScores, ...]
    methods: tuple[str, ...]
    counts: tuple[int, ...]
    samples: int

    def values(self, method: str, count: int, name: str) -> Float64:
        """A score of each scene."""
        return np.array([scene.scores[method][count][name] for scene in self.scenes])

    def interval(self, method: str, count: int, name: str) -> Interval:
        """The mean over scenes with bootstrap bounds."""
        values = self.values(method, count, name)[:, None]
        owners = [scene.scene for scene in self.scenes]
        return bootstrap_interval(values, owners, lambda means: means[..., 0])

    @property
    def floor(self) -> float:
        """Mean Chamfer distance that no method falls below (m)."""
        return float(np.mean([scene.floor for scene in self.scenes]))

    @property
    def reference(self) -> str | None:
        """The first method that learns nothing and is to be beaten."""
        return next((name for name in self.methods if described(name).reference), None)

    @property
    def figures(self) -> dict[str, float]:
        """`<method>/<views>/<name>` with bounds, the floor, and numbers of scenes and samples."""
        figures: dict[str, float] = {}
        for method in self.methods:
            for count in self.counts:
                for name in SCORES:
                    interval = self.interval(method, count, name)
                    for end, value in (
                        ("", interval.mean),
                        (LOW, interval.low),
                        (HIGH, interval.high),
                    ):
                        if np.isfinite(value):
                            figures[f"{method}/{count}/{name}{end}"] = value
        return figures | {
            FLOOR: self.floor,
            "scenes": float(len(self.scenes)),
            "samples": float(self.samples),
        }

    @property
    def measures(self) -> dict[str, Measure]:
        """Units, digits and the reference's figures."""
        measures = {**_NUMBERS, FLOOR: replace(SCORES["chamfer_full"], name="Chamfer floor")}
        for method in self.methods:
            row = described(method).row
            beaten = self.reference if described(method).learns else None
            for count in self.counts:
                views = f"{count} view" + "s" * (count > 1)
                for name, measure in SCORES.items():
                    measures[f"{method}/{count}/{name}"] = replace(
                        measure,
                        name=f"{measure.name or measure.heading}, {row}, {views}",
                        trivial=f"{beaten}/{count}/{name}" if beaten else None,
                        floor=FLOOR if name == "chamfer_full" else None,
                    )
        return measures
