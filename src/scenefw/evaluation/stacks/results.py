"""Results of an evaluation of reconstructions, view by view, and their summaries."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.evaluation.stacks.draw_results import DrawsResult
from scenefw.evaluation.stacks.measures import of_scores
from scenefw.evaluation.statistics import Interval, bootstrap_interval

VISIBILITY_EDGES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 1.0)
PIXEL_EDGES = (0, 1, 100, 300, 1000, 10_000, np.inf)


@dataclass(frozen=True)
class ViewScores:
    """Scores of all methods on one view.

    Args:
        scene: number of the scene in its data set.
        view: number of the view.
        visibility: visible area of the true surface over its whole area.
        floors: what the Chamfer distances of the truth to itself are, by name.
        methods: scores by method and name, means over the samples of the view.
        pixels: how many show each true object.
        objects: IoU of each true object by method, likewise.
    """

    scene: int
    view: int
    visibility: float
    floors: Mapping[str, float]
    methods: Mapping[str, Mapping[str, float]]
    pixels: Sequence[int] = ()
    objects: Mapping[str, Sequence[float]] = field(default_factory=dict)

    @classmethod
    def restored(cls, row: Mapping[str, Any]) -> Self:
        """Those of a row of JSON, as `dataclasses.asdict` makes it."""
        objects = {method: tuple(ious) for method, ious in row["objects"].items()}
        return cls(**{**row, "pixels": tuple(row["pixels"]), "objects": objects})


@dataclass(frozen=True)
class Summary:
    """Mean and standard deviation over views, and how many views those are."""

    mean: float
    sigma: float
    count: int


@dataclass(frozen=True)
class PixelBin:
    """True objects of which about as much is seen.

    Args:
        low: pixels that show each, at least.
        high: fewer than so many do.
        count: of objects.
        recall: share of them with an IoU above 1/2, by method.
        iou: mean IoU, by method.
    """

    low: float
    high: float
    count: int
    recall: Mapping[str, float]
    iou: Mapping[str, float]


@dataclass(frozen=True)
class ReconstructionResult:
    """Scores of every view of every scene.

    Names of scores: chamfer_visible, chamfer_full, chamfer_full_dense (m) with `_floor` (the truth
    sampled twice) and `_excess` over it, fscore_1cm, normal_consistency, occupancy_bce (hard
    occupancies averaged over samples), occupancy_bce_probability (nats), occupancy_iou,
    hidden_coverage, instance_iou, panoptic_quality, instance_recall, count_error, count_excess.

    Args:
        views: scores by view.
        methods: names, the main one first.
        samples: latent samples per view.
        seed: of views, codes and points.
        draws: samples judged as samples, on the first scenes; or None.
        published: data set of table 5.1 that these are like; or None.
    """

    views: tuple[ViewScores, ...]
    methods: tuple[str, ...]
    samples: int
    seed: int
    draws: DrawsResult | None = None
    published: str | None = "superquadrics"

    @property
    def scenes(self) -> int:
        """Number of scenes."""
        return len({view.scene for view in self.views})

    @property
    def visibility(self) -> NDArray[np.float64]:
        """Visible share of the true surface of each view."""
        return np.array([view.visibility for view in self.views])

    def names(self, method: str) -> tuple[str, ...]:
        """Names of a method's scores in the order of computation, each followed by its floor."""
        names = []
        for name in self.views[0].methods[method]:
            names.append(name)
            if name in self.views[0].floors:
                names += [f"{name}_floor", f"{name}_excess"]
        return tuple(names)

    def values(self, method: str, name: str) -> NDArray[np.float64]:
        """A score of each view; NaN where a view has none."""
        if name.endswith("_floor"):
            return np.array([view.floors[name.removesuffix("_floor")] for view in self.views])
        if name.endswith("_excess") and name.removesuffix("_excess") in self.views[0].floors:
            base = name.removesuffix("_excess")
            return self.values(method, base) - self.values(method, f"{base}_floor")
        return np.array([view.methods[method].get(name, np.nan) for view in self.views])

    def summary(
        self, method: str, name: str, visibility: tuple[float, float] | None = None
    ) -> Summary:
        """Mean and sigma over views, or over those with low <= visible share < high."""
        values = self.values(method, name)
        if visibility is not None:
            low, high = visibility
            values = values[(self.visibility >= low) & (self.visibility < high)]
        values = values[np.isfinite(values)]
        if not len(values):
            return Summary(float("nan"), float("nan"), 0)
        return Summary(float(values.mean()), float(values.std()), len(values))

    def interval(self, method: str, name: str) -> Interval:
        """Mean with bootstrap bounds over scenes."""
        scenes = [view.scene for view in self.views]
        values = self.values(method, name)[:, None]
        return bootstrap_interval(values, scenes, lambda means: means[..., 0])

    def by_visibility(
        self, method: str, name: str, edges: Sequence[float] = VISIBILITY_EDGES
    ) -> tuple[tuple[float, float, Summary], ...]:
        """(low, high, summary) of each bin of the visible share that holds views."""
        bins = [
            (low, high, self.summary(method, name, (low, high))) for low, high in pairwise(edges)
        ]
        return tuple(row for row in bins if row[2].count)

    def by_pixels(self, edges: Sequence[float] = PIXEL_EDGES) -> tuple[PixelBin, ...]:
        """True objects by the number of pixels that show them; bins without any are left out."""
        views = [view for view in self.views if view.objects]
        if not views:
            return ()
        pixels = np.concatenate([view.pixels for view in views])
        ious = {
            method: np.concatenate([view.objects[method] for view in views])
            for method in views[0].objects
        }
        bins = []
        for low, high in pairwise(edges):
            in_bin = (pixels >= low) & (pixels < high)
            if in_bin.any():
                recalls = {
                    name: float((values[in_bin] > 0.5).mean()) for name, values in ious.items()
                }
                means = {name: float(values[in_bin].mean()) for name, values in ious.items()}
                bins.append(PixelBin(low, high, int(in_bin.sum()), recalls, means))
        return tuple(bins)

    @property
    def figures(self) -> dict[str, float]:
        """Means over views by name; methods other than the main one as `<method>/<name>`."""
        figures: dict[str, float] = {}
        for method in self.methods:
            prefix = "" if method == self.methods[0] else f"{method}/"
            for name in self.names(method):
                if prefix and name.endswith("_floor"):
                    continue  # that of the truth, the same for all
                if self.summary(method, name).count:
                    figures |= _bounded(prefix + name, self.interval(method, name))
        counts = {"scenes": self.scenes, "views": len(self.views), "samples": self.samples}
        figures |= {"visibility": float(self.visibility.mean())} | self._of_draws()
        return figures | {name: float(count) for name, count in counts.items()}

    def _of_draws(self) -> dict[str, float]:
        """Figures of samples as samples, `draws/<method>/<name>`."""
        if self.draws is None or not self.draws.views:
            return {}
        figures = {"draws/scenes": float(self.draws.scenes), "draws/count": float(self.draws.count)}
        for method, intervals in self.draws.intervals.items():
            for name, interval in intervals.items():
                if np.isfinite(interval.mean):
                    figures |= _bounded(f"draws/{method}/{name}", interval)
        return figures

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits and published values of the figures."""
        sampled_methods = self.draws.methods if self.draws else ()
        return of_scores(self.methods, sampled_methods, self.published)


def _bounded(name: str, interval: Interval) -> dict[str, float]:
    """A figure, and its bounds as `<name>_low` and `<name>_high` where it has some."""
    bounds = {f"{name}{LOW}": interval.low, f"{name}{HIGH}": interval.high}
    finite_bounds = {key: value for key, value in bounds.items() if np.isfinite(value)}
    return {name: interval.mean} | finite_bounds
