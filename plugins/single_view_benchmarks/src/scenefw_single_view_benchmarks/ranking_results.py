"""What rankings put first, and how good that is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.evaluation.statistics import Interval, mean_interval, paired_interval

FIRST, ANY, BEST = "first", "any", "best"
"""The first hypothesis; any draw; the draw with the best instance IoU, which takes the truth."""

SCORES = {
    "instance_iou": Measure("instance IoU", better="higher"),
    "panoptic_quality": Measure("panoptic quality", better="higher"),
    "occupancy_iou": Measure("occupancy IoU", better="higher"),
    "displacement": Measure("displacement", "how far objects move at rest", "mm", 1, "lower", 1000),
}
_NUMBERS = {"scenes": Measure("scenes", digits=0), "draws": Measure("draws", digits=0)}


@dataclass(frozen=True)
class ViewChoices:
    """One view.

    Args:
        scene: number in its data set.
        chosen: scores by name of what was chosen: `FIRST`, `ANY`, `BEST`, and by each ranking.
    """

    scene: int
    chosen: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class RankingResult:
    """All views of a split.

    Args:
        views: one of each scene.
        rankings: names.
        draws: of each view.
    """

    views: tuple[ViewChoices, ...]
    rankings: tuple[str, ...]
    draws: int

    @property
    def rows(self) -> tuple[str, ...]:
        """What is compared: references around the rankings."""
        return (FIRST, ANY, *self.rankings, BEST)

    def score(self, row: str, name: str) -> Interval:
        """Mean with Student's bounds."""
        return mean_interval(self._values(row, name))

    def gain(self, row: str, name: str) -> Interval:
        """Beyond any draw of the same views."""
        return paired_interval(self._values(row, name), self._values(ANY, name))

    def _values(self, row: str, name: str) -> np.ndarray:
        return np.array([view.chosen[row][name] for view in self.views])

    @property
    def figures(self) -> dict[str, float]:
        """`<row>/<score>` with bounds."""
        figures = {"scenes": float(len(self.views)), "draws": float(self.draws)}
        for row in self.rows:
            for name in SCORES:
                interval = self.score(row, name)
                ends = {"": interval.mean, LOW: interval.low, HIGH: interval.high}
                figures |= {f"{row}/{name}{end}": v for end, v in ends.items() if np.isfinite(v)}
        return figures

    @property
    def measures(self) -> dict[str, Measure]:
        """Units and digits."""
        rows = {f"{row}/{name}": measure for row in self.rows for name, measure in SCORES.items()}
        return {**_NUMBERS, **rows}
