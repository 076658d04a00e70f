"""The evaluation: counts of test views beside the base rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core import rng
from scenefw.core.errors import ConfigError
from scenefw.core.measures import Measure
from scenefw.data.batches.views import ViewMaker
from scenefw.evaluation.statistics import paired_interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.protocols import MappingMethod, Noise, Renderer, Track
    from scenefw.data.batches.stacks import StackScenes
    from scenefw.data.batches.views import Viewpoints
    from scenefw_object_count.counters import Counter

_VIEW_STREAM = 1
BASE_RATE = "base_rate"
_SCORES = {
    "log_score": Measure("log score", unit="nats", better="lower"),
    "accuracy": Measure("right", "most probable number is right", "%", 1, "higher", 100.0),
    "count_error": Measure("too many or too few", "objects too many or too few", "", 2, "lower"),
}
_OTHERS = {
    "gain": Measure("gain", "log score gained over the base rate", "nats", better="higher"),
    "gain_low": Measure("low", "the same, lower bound (95 %)", "nats", better="higher"),
    "gain_high": Measure("high", "the same, upper bound (95 %)", "nats", better="higher"),
    "scenes": Measure("scenes", digits=0),
    "views": Measure("views", digits=0),
}


@dataclass(frozen=True)
class CountedView:
    """A test view and what each method says of it.

    Args:
        scene: number of the scene in its data set.
        count: how many objects it has.
        probabilities: (N,) of 1, 2, ..., N objects by method.
    """

    scene: int
    count: int
    probabilities: Mapping[str, NDArray[np.float64]]

    def scores(self, method: str) -> dict[str, float]:
        """Log score, whether the most probable number is right, and how far off it is."""
        probabilities = self.probabilities[method]
        prediction = int(probabilities.argmax()) + 1
        of_truth = probabilities[self.count - 1] if self.count <= len(probabilities) else 0.0
        return {
            "log_score": float(-np.log(max(of_truth, np.finfo(np.float64).tiny))),
            "accuracy": float(prediction == self.count),
            "count_error": float(abs(prediction - self.count)),
        }


@dataclass(frozen=True)
class CountResult:
    """What was found on all views.

    Args:
        views: in their order.
        methods: names, the main one first.
    """

    views: tuple[CountedView, ...]
    methods: tuple[str, ...]

    @property
    def figures(self) -> dict[str, float]:
        """Means over views; of other methods than the main one as `<method>/<name>`."""
        figures: dict[str, float] = {}
        for method in self.methods:
            prefix = "" if method == self.methods[0] else f"{method}/"
            rows = [view.scores(method) for view in self.views]
            figures |= {prefix + n: float(np.mean([row[n] for row in rows])) for n in _SCORES}
        if BASE_RATE in self.methods[1:]:
            figures |= self._gain()
        scenes = {view.scene for view in self.views}
        return figures | {"scenes": float(len(scenes)), "views": float(len(self.views))}

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits, and which figure says what can be had without learning."""
        compared = BASE_RATE in self.methods[1:]
        measures = {
            name: measure.changed({"trivial": f"{BASE_RATE}/{name}" if compared else None})
            for name, measure in _SCORES.items()
        }
        for method in self.methods[1:]:
            for name, measure in _SCORES.items():
                words = f"{measure.name or measure.heading}, {method.replace('_', ' ')}"
                measures[f"{method}/{name}"] = measure.changed({"name": words})
        return measures | _OTHERS

    def _gain(self) -> dict[str, float]:
        """Of scenes, as views of one scene are not independent; bounds need two scenes."""
        by_scene: dict[int, list[float]] = {}
        for view in self.views:
            ours, theirs = (view.scores(m)["log_score"] for m in (self.methods[0], BASE_RATE))
            by_scene.setdefault(view.scene, []).append(theirs - ours)
        gains = [float(np.mean(values)) for values in by_scene.values()]
        interval = paired_interval(gains, np.zeros(len(gains)))
        bounds = {"gain_low": interval.low, "gain_high": interval.high}
        return {"gain": interval.mean, **{n: v for n, v in bounds.items() if np.isfinite(v)}}


class CountEvaluation:
    """Scores methods that count on random views of test scenes, all on the same views.

    Args:
        scenes: of the test split.
        methods: by name; the first is the main one, and its grid is that of the views.
        viewpoints: draws cameras.
        renderer: makes depth images of the true TSDF.
        mapping: from depth to partial TSDF.
        noise: disturbs the depth images.
        views: cameras per scene.
        seed: of cameras and noise.
        device: where volumes and views are computed.

    Raises:
        ConfigError: no view, or the first method has no grid.
    """

    def __init__(
        self,
        scenes: StackScenes,
        methods: Mapping[str, Counter],
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        noise: Mapping[str, Noise] | None = None,
        views: int = 1,
        seed: int = 0,
        device: str = "cpu",
    ) -> None:
        grid = next(iter(methods.values())).grid if methods else None
        if grid is None or views < 1:
            raise ConfigError(
                "counts are evaluated on the grid of the first of evaluation.methods, from 1 or "
                f"more views per scene; got {', '.join(methods) or 'no method'} and {views} views"
            )
        self.scenes, self.methods, self.grid = scenes, dict(methods), grid
        self.maker = ViewMaker(grid, viewpoints, renderer, mapping, noise)
        self.views, self.seed, self.device = views, seed, device

    def run(self, track: Track = lambda pairs, _: pairs) -> CountResult:
        """Scores all views; `track(items, what)` shows a bar of the loop."""
        pairs = list(product(range(len(self.scenes)), range(self.views)))
        views = tuple(self.look(scene, view) for scene, view in track(pairs, "test views"))
        return CountResult(views, tuple(self.methods))

    @torch.no_grad()
    def look(self, scene: int, view: int) -> CountedView:
        """What all methods say of one view of one scene of the split."""
        parameters = self.scenes.parameters([scene], self.device)
        random = rng.generator(self.seed, _VIEW_STREAM, scene, view)
        partial = self.maker.make_one(parameters, random).partial
        probabilities = {
            name: method.probabilities(partial, self.grid)[0].numpy()
            for name, method in self.methods.items()
        }
        count = int(parameters.present.sum())
        return CountedView(int(self.scenes.indices[scene]), count, probabilities)
