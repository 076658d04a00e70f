"""How stable piles are, view by view, and their summaries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.core.types import Float64
from scenefw.evaluation.stacks import published
from scenefw.evaluation.stacks.methods import REFERENCES
from scenefw.evaluation.stacks.results import VISIBILITY_EDGES
from scenefw.evaluation.statistics import Interval, bootstrap_interval, median_interval

TRUTH = "truth"
"""Name of the row of true scenes."""

SCORES = {
    "displacement": Measure(
        "mean", "displacement of objects, mean over piles", "cm", 1, "lower", 100.0
    ),
    "displacement_median": Measure(
        "median", "displacement of objects, median over piles", "cm", 1, "lower", 100.0
    ),
    "stable": Measure("stable", "stable piles", "%", 0, "higher", 100.0),
    "objects": Measure("objects", "objects of a pile", digits=1),
    "left_out": Measure("left out", "objects of a pile that are no solids", digits=2),
    "divided": Measure("in parts", "objects of a pile that collide in parts", digits=2),
}
_MAIN = "drawn"  # the method that is the thesis's
_NUMBERS = {
    "scenes": Measure("scenes", digits=0),
    "views": Measure("views", digits=0),
    "steps": Measure("steps", "steps of each simulation", digits=0),
}


@dataclass(frozen=True)
class Pile:
    """What a simulation did to one scene.

    Args:
        shifts: how far the centre of each object moved (m).
        turns: how far each turned (degrees).
        left_out: objects that are no solids.
        divided: objects that collide in several convex parts.
    """

    shifts: tuple[float, ...]
    turns: tuple[float, ...]
    left_out: int = 0
    divided: int = 0

    def scores(self, furthest: float, steepest: float) -> dict[str, float]:
        """By name; a pile without objects isn't stable and has no displacement."""
        count = len(self.shifts)
        stable = count > 0 and max(self.shifts) < furthest and max(self.turns) < steepest
        return {
            "displacement": float(np.mean(self.shifts)) if count else float("nan"),
            "stable": float(stable),
            "objects": float(count),
            "left_out": float(self.left_out),
            "divided": float(self.divided),
        }


@dataclass(frozen=True)
class ViewPiles:
    """Piles of one view.

    Args:
        scene: number of the scene in its data set.
        view: number of the view.
        visibility: visible area of the true surface over its whole area.
        piles: of each method, one per sample.
    """

    scene: int
    view: int
    visibility: float
    piles: Mapping[str, tuple[Pile, ...]]

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> ViewPiles:
        """What `dataclasses.asdict` made JSON types of."""
        piles = {
            method: tuple(
                Pile(**{**pile, "shifts": tuple(pile["shifts"]), "turns": tuple(pile["turns"])})
                for pile in method_piles
            )
            for method, method_piles in row["piles"].items()
        }
        return cls(row["scene"], row["view"], row["visibility"], piles)


@dataclass(frozen=True)
class StabilityResult:
    """Piles of every view of every scene.

    Args:
        views: with their piles.
        methods: names, the truth first.
        steps: of each simulation.
        furthest, steepest: of stable piles (m, degrees).
        published: data set of table 5.1 that these are like; or None.
    """

    views: tuple[ViewPiles, ...]
    methods: tuple[str, ...]
    steps: int
    furthest: float
    steepest: float
    published: str | None = "superquadrics"

    @property
    def visibility(self) -> Float64:
        """Visible share of the true surface of each view."""
        return np.array([view.visibility for view in self.views])

    def values(self, method: str, name: str) -> Float64:
        """A score of each view, its mean over the samples; NaN where no sample has one."""
        means = []
        for view in self.views:
            rows = [p.scores(self.furthest, self.steepest)[name] for p in view.piles[method]]
            finite_rows = [row for row in rows if np.isfinite(row)]
            means.append(float(np.mean(finite_rows)) if finite_rows else float("nan"))
        return np.array(means)

    def interval(self, method: str, name: str) -> Interval:
        """Mean, or median where the name says so, with bootstrap bounds over scenes."""
        scenes = [view.scene for view in self.views]
        if name == "displacement_median":
            return median_interval(self.values(method, "displacement"), scenes)
        values = self.values(method, name)[:, None]
        return bootstrap_interval(values, scenes, lambda means: means[..., 0])

    def by_visibility(
        self, method: str, name: str, edges: Sequence[float] = VISIBILITY_EDGES
    ) -> tuple[float | None, ...]:
        """Mean over the views of each bin of the visible share; None where a bin has none."""
        values, visibility = self.values(method, name), self.visibility
        bins = [values[(visibility >= low) & (visibility < high)] for low, high in pairwise(edges)]
        finite_bins = [part[np.isfinite(part)] for part in bins]
        return tuple(float(part.mean()) if len(part) else None for part in finite_bins)

    @property
    def figures(self) -> dict[str, float]:
        """`<method>/<name>` with bounds, and the numbers of scenes, views and steps."""
        figures: dict[str, float] = {}
        for method in self.methods:
            for name in SCORES:
                interval = self.interval(method, name)
                bounds = {"": interval.mean, LOW: interval.low, HIGH: interval.high}
                figures |= {
                    f"{method}/{name}{end}": value
                    for end, value in bounds.items()
                    if np.isfinite(value)
                }
        scenes = len({view.scene for view in self.views})
        numbers = {"scenes": scenes, "views": len(self.views), "steps": self.steps}
        return figures | {name: float(value) for name, value in numbers.items()}

    @property
    def measures(self) -> dict[str, Measure]:
        """Units, digits and published values of the figures."""
        reference = next((name for name in REFERENCES if name in self.methods), None)
        theirs = {
            name: figure.mean for name, figure in published.thesis_figures(self.published).items()
        }
        measures = dict(_NUMBERS)
        for method in self.methods:
            learned = reference and method not in (TRUTH, *REFERENCES)
            for name, measure in SCORES.items():
                measures[f"{method}/{name}"] = replace(
                    measure,
                    name=f"{measure.name or measure.heading}, {method.replace('_', ' ')}",
                    trivial=f"{reference}/{name}" if learned else None,
                    published=theirs.get(name) if method == _MAIN else None,
                )
        return measures
