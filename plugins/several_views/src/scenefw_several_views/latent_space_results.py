"""Variety of draws against the number of views, ways between codes, and their summaries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.evaluation.statistics import Interval, bootstrap_interval

CODES, BLENDED = "codes", "blended"
"""Ways from one scene to another: through codes, or as a mean of both volumes."""

VARIETY = {
    "among": Measure("draws apart", "distance of shapes among draws"),
    "to_truth": Measure("from the truth", "distance of shapes of draws to the truth"),
    "zero_to_truth": Measure("zero code from the truth", "distance of the zero code to the truth"),
    "instances_among": Measure("instances apart", "distance of instances among draws"),
    "instances_to_truth": Measure("from the truth", "distance of instances to the truth"),
    "seen": Measure(
        "seen, of what differs", "share of what differs that was seen", "%", 0, None, 100
    ),
    "observed": Measure(
        "seen, of all objects", "share of objects that was seen", "%", 0, None, 100
    ),
}
"""By number of views. Distances are 1 - IoU."""

WAYS = {
    "length": Measure("length", "length of the way, in distances of its ends", "", 2),
    "largest": Measure("largest step", "largest step, of the whole way", "%", 0, "lower", 100.0),
    "ends": Measure("error at the ends", "distance to the truth at the ends"),
    "middle": Measure("in the middle", "distance to the truth in the middle"),
    "fewest": Measure("fewest objects", "fewest objects on the way", "", 1),
    "most": Measure("most", "most objects on the way", "", 1),
}
"""Of ways from one draw to another."""


@dataclass(frozen=True)
class SceneCodes:
    """What codes change of one scene.

    Args:
        scene: number in its data set.
        variety: by number of views and name.
        ways: by kind and name.
    """

    scene: int
    variety: Mapping[int, Mapping[str, float]]
    ways: Mapping[str, Mapping[str, float]]

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> SceneCodes:
        """What `dataclasses.asdict` and JSON, which knows only text as keys, made rows of."""
        variety = {int(count): scores for count, scores in row["variety"].items()}
        return cls(row["scene"], variety, row["ways"])


@dataclass(frozen=True)
class LatentSpaceResult:
    """Scores of every scene.

    Args:
        scenes: with their scores.
        counts: numbers of views.
        samples: codes per scene.
        steps: of each way.
    """

    scenes: tuple[SceneCodes, ...]
    counts: tuple[int, ...]
    samples: int
    steps: int

    def variety(self, count: int, name: str) -> Interval:
        """A mean over scenes with bootstrap bounds."""
        return self._interval([scene.variety[count][name] for scene in self.scenes])

    def ratio(self, count: int) -> Interval:
        """Mean distance among draws by the mean distance to the truth: 1 where draws are right."""
        rows = [
            [scene.variety[count]["among"], scene.variety[count]["to_truth"]]
            for scene in self.scenes
        ]
        owners = [scene.scene for scene in self.scenes]
        return bootstrap_interval(
            np.array(rows), owners, lambda m: m[..., 0] / np.maximum(m[..., 1], 1e-9)
        )

    def way(self, kind: str, name: str) -> Interval | None:
        """A mean over scenes with bootstrap bounds; None where there is no such figure."""
        values = [scene.ways[kind].get(name, float("nan")) for scene in self.scenes]
        return self._interval(values) if np.isfinite(values).any() else None

    def _interval(self, values: list[float]) -> Interval:
        owners = [scene.scene for scene in self.scenes]
        return bootstrap_interval(np.array(values)[:, None], owners, lambda means: means[..., 0])

    @property
    def figures(self) -> dict[str, float]:
        """`views/<number>/<name>` and `<way>/<name>` with bounds, and numbers of scenes."""
        figures: dict[str, float] = {"scenes": float(len(self.scenes))}
        for count in self.counts:
            figures |= _bounded(f"views/{count}/ratio", self.ratio(count))
            for name in VARIETY:
                figures |= _bounded(f"views/{count}/{name}", self.variety(count, name))
        for kind in (CODES, BLENDED):
            for name in WAYS:
                interval = self.way(kind, name)
                figures |= {} if interval is None else _bounded(f"{kind}/{name}", interval)
        return figures

    @property
    def measures(self) -> dict[str, Measure]:
        """Units and digits."""
        measures = {"scenes": Measure("scenes", digits=0)}
        for count in self.counts:
            views = f"{count} view" + "s" * (count > 1)
            words = f"variety by error, {views}"
            measures[f"views/{count}/ratio"] = Measure("variety by error", words, digits=2)
            for name, measure in VARIETY.items():
                measures[f"views/{count}/{name}"] = measure.changed(
                    {"name": f"{measure.name}, {views}"}
                )
        for kind in (CODES, BLENDED):
            for name, measure in WAYS.items():
                measures[f"{kind}/{name}"] = measure.changed({"name": f"{measure.name}, {kind}"})
        return measures


def _bounded(name: str, interval: Interval) -> dict[str, float]:
    ends = {name: interval.mean, f"{name}{LOW}": interval.low, f"{name}{HIGH}": interval.high}
    return {key: value for key, value in ends.items() if np.isfinite(value)}
