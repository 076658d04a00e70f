"""What samples of test views are worth: skills, energy scores and reliability, with bounds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, reduce
from operator import add
from typing import NamedTuple

import numpy as np

from scenefw.core.types import Float64
from scenefw.evaluation.stacks.draws import DrawOutcome
from scenefw.evaluation.statistics import Interval, bootstrap_interval
from scenefw.metrics.forecasts import (
    Outcomes,
    brier_score,
    calibration_error,
    count_score,
    log_score,
)
from scenefw.metrics.object_sets import energy_score

BEST_OF = (1, 3, 10)


@dataclass(frozen=True)
class DrawView:
    """Outcomes of all methods on one view of a scene."""

    scene: int
    methods: Mapping[str, DrawOutcome]


class Maps(NamedTuple):
    """What calibration views teach.

    Calibrated probabilities by class: of voxels, of pairs, of pairs by distance, of any pair; and
    how many objects are hidden in each view.
    """

    occupancy: Float64
    pairs: Float64
    pairs_by_distance: Float64
    rate: Float64
    hidden: Float64


@dataclass(frozen=True)
class DrawsResult:
    """Samples judged as samples.

    Args:
        views: of test scenes.
        calibration: of validation scenes; the probabilities of all scores are fitted on them.
        methods: names.
        count: samples per view.
    """

    views: tuple[DrawView, ...]
    calibration: tuple[DrawView, ...]
    methods: tuple[str, ...]
    count: int

    @property
    def scenes(self) -> int:
        """Number of test scenes."""
        return len({view.scene for view in self.views})

    @cached_property
    def maps(self) -> Mapping[str, Maps]:
        """Calibrated probabilities of each method, isotonic in its own forecasts."""
        return {
            name: fitted([view.methods[name] for view in self.calibration]) for name in self.methods
        }

    @cached_property
    def values(self) -> Mapping[str, Mapping[str, Float64]]:
        """Figures by method and name, one per view."""
        return {name: self._values(name) for name in self.methods}

    @cached_property
    def intervals(self) -> Mapping[str, Mapping[str, Interval]]:
        """Figures by method and name, with bootstrap bounds over scenes.

        A skill 1 - a / b is that of the means of a and b, not the mean of skills.
        """
        return {name: self._intervals(self.values[name]) for name in self.methods}

    def reliability(self, method: str, part: str) -> Outcomes:
        """Outcomes of all test views: `pairs`, or `unseen` voxels, by class of the forecast."""
        outcomes = [view.methods[method] for view in self.views]
        if part == "pairs":
            return reduce(add, [outcome.pairs for outcome in outcomes])
        return reduce(add, [half(outcome.occupancy, 1) for outcome in outcomes])

    def _values(self, name: str) -> dict[str, Float64]:
        rows = [scores(view.methods[name], self.maps[name]) for view in self.views]
        return {key: np.array([row[key] for row in rows]) for key in rows[0]}

    def _intervals(self, values: Mapping[str, Float64]) -> dict[str, Interval]:
        scenes = [view.scene for view in self.views]

        def bounds(names: Sequence[str], of: Callable[..., Float64]) -> Interval:
            return bootstrap_interval(np.stack([values[n] for n in names], axis=1), scenes, of)

        intervals = {name: bounds([name], lambda means: means[..., 0]) for name in values}
        for skill, (score, trivial) in SKILLS.items():
            intervals[skill] = bounds(
                [score, trivial], lambda means: 1 - means[..., 0] / means[..., 1]
            )
        for ratio, (above, below) in RATIOS.items():
            intervals[ratio] = bounds([above, below], lambda means: means[..., 0] / means[..., 1])
        return intervals


SKILLS = {
    "log_skill": ("log", "trivial_log"),
    "brier_skill": ("brier", "trivial_brier"),
    "log_skill_unseen": ("log_unseen", "trivial_log_unseen"),
    "brier_skill_unseen": ("brier_unseen", "trivial_brier_unseen"),
    "pairs_skill": ("pairs_log", "pairs_log_by_distance"),
    "pairs_skill_rate": ("pairs_log", "pairs_log_rate"),
}
"""Name of a skill: the score and the trivial score between which and 0 it is the share."""
RATIOS = {"chamfer_visible_ratio": ("chamfer_visible_further", "chamfer_visible_first")}
"""Name of a ratio: the figure above, and the one below."""


def fitted(outcomes: Sequence[DrawOutcome]) -> Maps:
    """Maps of forecasts to probabilities, seen and unseen voxels apart."""
    occupancy = reduce(add, [outcome.occupancy for outcome in outcomes])
    pairs, pairs_by_distance = (
        reduce(add, [getattr(o, n) for o in outcomes]) for n in ("pairs", "pairs_by_distance")
    )
    probabilities = [half(occupancy, part).calibrated() for part in (0, 1)]
    rate = Outcomes(*(np.array([getattr(pairs, f.name).sum()]) for f in fields(pairs)))
    hidden = np.array([outcome.truly_hidden for outcome in outcomes], dtype=np.float64)
    return Maps(
        np.concatenate(probabilities),
        pairs.calibrated(),
        pairs_by_distance.frequencies(),
        rate.frequencies(),
        hidden,
    )


def scores(outcome: DrawOutcome, maps: Maps) -> dict[str, float]:
    """Figures of one view."""
    unseen, probabilities = half(outcome.occupancy, 1), np.split(maps.occupancy, 2)[1]
    further_count = max(len(outcome.chamfer_visible) - 1, 1)
    means = {
        "log": log_score(outcome.occupancy, maps.occupancy),
        "brier": brier_score(outcome.occupancy, maps.occupancy),
        "log_unseen": log_score(unseen, probabilities),
        "brier_unseen": brier_score(unseen, probabilities),
        "unseen_error": calibration_error(unseen),
        "coverage": outcome.coverage,
        "pairs_log": log_score(outcome.pairs, maps.pairs),
        "pairs_log_by_distance": log_score(outcome.pairs_by_distance, maps.pairs_by_distance),
        "pairs_log_rate": log_score(outcome.pairs, np.repeat(maps.rate, len(outcome.pairs.total))),
        "pairs_error": calibration_error(outcome.pairs),
        "distance": float(outcome.to_truth.mean()),
        "energy": energy_score(outcome.to_truth, outcome.among),
        "spread": _spread(outcome.among),
        "instance_iou": float(outcome.instance_iou.mean()),
        "panoptic_quality": float(outcome.panoptic_quality.mean()),
        "occupancy_iou": float(outcome.occupancy_iou.mean()),
        "chamfer_visible_first": float(outcome.chamfer_visible[0]),
        "chamfer_visible_further": float(outcome.chamfer_visible[-further_count:].mean()),
        "hidden_true": float(outcome.truly_hidden),
        "hidden_drawn": float(outcome.hidden_objects.mean()),
        "hidden_score": count_score(outcome.hidden_objects, outcome.truly_hidden),
        "trivial_hidden_score": count_score(maps.hidden, outcome.truly_hidden),
    }
    best = {}
    for count in BEST_OF:
        best[f"distance_best_{count}"] = float(outcome.to_truth[:count].min())
        best[f"instance_iou_best_{count}"] = float(outcome.instance_iou[:count].max())
    return means | best | {f"trivial_{name}": value for name, value in outcome.trivial.items()}


def half(outcomes: Outcomes, part: int) -> Outcomes:
    """Outcomes of seen voxels (0) or of unseen ones (1)."""
    return Outcomes(*(np.split(getattr(outcomes, f.name), 2)[part] for f in fields(outcomes)))


def _spread(among: Float64) -> float:
    samples = len(among)
    return float(among.sum() / (samples * (samples - 1))) if samples > 1 else 0.0
