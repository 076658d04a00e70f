"""Results of drawing whole scenes: distributions, tests, stability, novelty."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.evaluation.statistics import Interval, mean_interval, median_interval
from scenefw_scene_prior.two_samples import energy_distance, permutation_test

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from scenefw.core.batches import SceneParameters

    Array = NDArray[np.float64]

DRAWN, GIVEN, TRUTH, TRAINING = "drawn", "given", "truth", "training"
APART, AT_REST = "drawn_apart", "drawn_at_rest"
SHUFFLED, JITTERED = "shuffled", "jittered"
SHUFFLED_APART, SHUFFLED_AT_REST = "shuffled_apart", "shuffled_at_rest"
UNLEARNED = {
    DRAWN: SHUFFLED,
    APART: SHUFFLED_APART,
    AT_REST: SHUFFLED_AT_REST,
    GIVEN: SHUFFLED,
}
"""What is done to scenes that learn nothing, as to those of a network."""

QUANTITIES = {
    "count": Measure("objects", "objects of a scene", "", 2),
    "volume": Measure("volume", "volume of an object", "cm³", 0, factor=1e6),
    "height": Measure("height", "height of centres", "cm", 1, factor=100.0),
    "distance": Measure("distance", "distance of two centres", "cm", 1, factor=100.0),
    "penetration": Measure(
        "shared", "volume that objects of a scene share", "cm³", 1, "lower", 1e6
    ),
    "sunk": Measure("below the floor", "how far a scene reaches below", "mm", 1, "lower", 1000.0),
}
"""Means over scenes."""

GAPS = {
    name: Measure(
        measure.heading,
        f"{measure.name}: distance of the distribution to that of true scenes",
        measure.unit,
        max(measure.digits, 1),
        "lower",
        measure.factor,
    )
    for name, measure in QUANTITIES.items()
}
"""Wasserstein's distance of order 1."""

SCORES = {
    "energy": Measure("energy distance", "energy distance to true scenes", "", 3, "lower"),
    "chance": Measure("p", "probability of such a distance by chance"),
    "stable": Measure("stable", "stable piles", "%", 1, "higher", 100.0),
    "displacement": Measure("displacement", "median displacement", "cm", 1, "lower", 100.0),
    "novelty": Measure("nearest", "median distance to the nearest training scene", "", 2),
}

OTHERS = {
    "scenes": Measure("scenes", digits=0),
    "stable_ratio": Measure("stable", "stable piles, drawn / true", "", 2, "higher"),
    "novelty_ratio": Measure("nearest", "nearest training scene, drawn / true", "", 2),
}


@dataclass(frozen=True, eq=False)
class Sample:
    """Scenes of one kind.

    Args:
        values: `scene_numbers.quantities` of each.
        descriptors: (S, D).
        stable: (S,) bool.
        shifts: (S,) mean displacement of its objects (m).
        nearest: (S,) distance to the nearest training scene.
    """

    values: tuple[Mapping[str, Array], ...]
    descriptors: Array
    stable: NDArray[np.bool_]
    shifts: Array
    nearest: Array

    def pooled(self, name: str) -> Array:
        """All values of a quantity."""
        return np.concatenate([scene_values[name] for scene_values in self.values])

    def interval(self, name: str) -> Interval:
        """Mean over scenes of a quantity's mean, with bounds."""
        return mean_interval(
            [scene_values[name].mean() for scene_values in self.values if len(scene_values[name])]
        )


@dataclass(frozen=True, eq=False)
class ViewDraws:
    """One view: what is true, and what is drawn.

    Args:
        truth: one scene.
        draws: several.
        eye: where the camera is (m).
    """

    truth: SceneParameters
    draws: SceneParameters
    eye: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class PriorResult:
    """Samples of scenes, learned ones first.

    Args:
        samples: by kind.
        examples: some scenes of each kind that is shown.
        views: to show.
        split: that the true scenes are of.
    """

    samples: Mapping[str, Sample]
    examples: Mapping[str, SceneParameters]
    views: tuple[ViewDraws, ...]
    split: str

    @cached_property
    def scores(self) -> dict[str, dict[str, Interval]]:
        """Of each kind by name, with bounds where there are some."""
        return {kind: self._scores(kind) for kind in self.samples}

    def _scores(self, kind: str) -> dict[str, Interval]:
        sample, true = self.samples[kind], self.samples[TRUTH]
        rows = range(len(sample.stable))
        scores = {name: sample.interval(name) for name in QUANTITIES}
        scores |= {
            "stable": share_interval(sample.stable),
            "displacement": median_interval(sample.shifts, rows),
            "novelty": median_interval(sample.nearest, rows),
        }
        if kind == TRUTH:
            return scores
        scale = [self.samples[name].descriptors for name in (TRAINING, SHUFFLED)]
        unit = np.maximum(np.concatenate(scale).std(axis=0), 1e-6)
        descriptors = sample.descriptors / unit, true.descriptors / unit
        scores["energy"] = energy_distance(*descriptors)
        scores["chance"] = _point_interval(permutation_test(*descriptors))
        for name in QUANTITIES:
            pooled = sample.pooled(name), true.pooled(name)
            gap = stats.wasserstein_distance(*pooled) if all(map(len, pooled)) else float("nan")
            scores[f"{name}_gap"] = _point_interval(float(gap))
        return scores

    @property
    def figures(self) -> dict[str, float]:
        """`<kind>/<name>` with bounds, ratios of drawn and true scenes, and how many there are."""
        figures: dict[str, float] = {}
        for kind, scores in self.scores.items():
            for name, interval in scores.items():
                ends = {"": interval.mean, LOW: interval.low, HIGH: interval.high}
                figures |= {
                    f"{kind}/{name}{end}": value
                    for end, value in ends.items()
                    if np.isfinite(value)
                }
        for name in ("stable", "novelty"):
            above, below = (self.scores[kind][name].mean for kind in (DRAWN, TRUTH))
            if below > 0 and np.isfinite(above):
                figures[f"{name}_ratio"] = above / below
        return figures | {"scenes": float(len(self.samples[TRUTH].stable))}

    @property
    def measures(self) -> dict[str, Measure]:
        """Units and digits, and what the reference that learns nothing reaches."""
        gaps = {f"{name}_gap": measure for name, measure in GAPS.items()}
        measures = dict(OTHERS)
        for kind in self.samples:
            for name, measure in (QUANTITIES | gaps | SCORES).items():
                changes = {
                    "name": f"{measure.name}, {kind}",
                    "trivial": f"{UNLEARNED[kind]}/{name}" if kind in UNLEARNED else None,
                }
                measures[f"{kind}/{name}"] = measure.changed(changes)
        return measures


def share_interval(marks: NDArray[np.bool_], confidence: float = 0.95) -> Interval:
    """Share of marks that are set, with Wilson's bounds (1927)."""
    count = len(marks)
    if not count:
        return _point_interval(float("nan"))
    bounds = stats.binomtest(int(marks.sum()), count).proportion_ci(confidence, method="wilson")
    return Interval(float(marks.mean()), float(bounds.low), float(bounds.high), count)


def _point_interval(value: float) -> Interval:
    return Interval(value, float("nan"), float("nan"), 1)
