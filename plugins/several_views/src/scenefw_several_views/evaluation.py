"""Shape and instances from one view, two, and more (thesis 5.3.4, fig. 5.35)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core import rng
from scenefw.core.errors import ConfigError
from scenefw.data.batches.views import ViewBatch, ViewMaker, Viewpoints
from scenefw.evaluation.kept_rows import KeptRows
from scenefw.evaluation.scored_scenes import scored_scenes, workers_on
from scenefw.evaluation.stacks.surface_scores import Surfaces, SurfaceScoring, TruePoints
from scenefw.evaluation.stacks.visibility import VisibleSurface
from scenefw.kernels.cameras import camera_of
from scenefw.metrics.instances import instance_scores
from scenefw.metrics.occupancy import occupancy_iou
from scenefw.postprocessing.surfaces import surface
from scenefw_several_views.results import SceneScores, SeveralViewsResult
from scenefw_several_views.scene_in_views import SceneInViews

if TYPE_CHECKING:
    from scenefw.core.batches import Completion
    from scenefw.core.protocols import (
        MappingMethod,
        Matching,
        Noise,
        Renderer,
        Track,
    )
    from scenefw.core.types import GridSpec
    from scenefw.data.batches.stacks import SceneSet
    from scenefw_decomposing.protocols import SeveralViewsReconstructor

_VIEWS, _POINTS, _CODES = 21, 22, 23  # random streams


class SeveralViewsEvaluation:
    """Scores methods on the first view of each scene, the first two, and so on.

    All methods see the same views, and what one sees of a scene it has seen with fewer views too.

    Args:
        scenes: of a split.
        methods: by name; None leaves one out.
        viewpoints: draws cameras.
        renderer: makes depth images of the true TSDF.
        mapping: from depth to partial TSDF.
        noise: disturbs the depth images.
        grid: for methods that have no grid of their own, if none has.
        counts: numbers of views.
        samples: latent samples; the thesis takes 2.
        surfaces: compares surfaces.
        matching: of predicted to true objects.
        seed: of cameras, noise, codes and points.
        device: where volumes and views are computed.
        workers: scenes at once; None: on the CPU as many as torch has threads, on a GPU one.
        kept: finished scenes of an interrupted run; None keeps none.

    Raises:
        ConfigError: no method, no grid, several grids, or a number below one.
    """

    def __init__(
        self,
        scenes: SceneSet,
        methods: Mapping[str, SeveralViewsReconstructor | None],
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        noise: Mapping[str, Noise] | None = None,
        grid: GridSpec | None = None,
        counts: Sequence[int] = (1, 2, 3, 4, 5, 6),
        samples: int = 2,
        surfaces: SurfaceScoring | None = None,
        matching: Matching | None = None,
        seed: int = 0,
        device: str = "cpu",
        workers: int | None = None,
        kept: KeptRows | None = None,
    ) -> None:
        self.kept = kept
        self.methods = {name: method for name, method in methods.items() if method is not None}
        self.counts = tuple(sorted(set(counts)))
        if not self.methods or not self.counts or self.counts[0] < 1 or samples < 1:
            raise ConfigError(
                f"several views need methods, numbers of views and samples, got "
                f"{len(self.methods)}, {list(counts)} and {samples}; expected at least 1 of each"
            )
        grids: set[GridSpec | None] = {
            method.grid for method in self.methods.values() if method.grid
        }
        grids = grids or {grid}
        if len(grids) > 1:
            raise ConfigError("the methods have several grids; give networks of one grid")
        (common,) = grids
        if common is None:
            raise ConfigError("no method has its own grid; give evaluation.grid=${grid}")
        self.grid, self.scenes, self.samples = common, scenes, samples
        self.maker = ViewMaker(common, viewpoints, renderer, mapping, noise)
        self.visible = VisibleSurface(renderer)
        self.surfaces = surfaces or SurfaceScoring()
        self.matching, self.seed, self.device = matching, seed, device
        self.workers = workers_on(device, workers)

    def run(self, track: Track = lambda items, _: items) -> SeveralViewsResult:
        """Scores all scenes; `track(items, what)` shows a bar of the loop."""
        scenes = scored_scenes(
            self.score, len(self.scenes), SceneScores.from_row, track, self.kept, self.workers
        )
        return SeveralViewsResult(tuple(scenes), tuple(self.methods), self.counts, self.samples)

    def see(self, row: int) -> SceneInViews:
        """All views of one scene."""
        streams = (self.seed, _VIEWS, _CODES)
        return SceneInViews.of(self.scenes, row, self.maker, self.counts[-1], streams, self.device)

    @torch.no_grad()
    def completions(self, scene_views: SceneInViews) -> Iterator[tuple[str, int, list[Completion]]]:
        """Different scenes that each method makes of each number of views."""
        for name in self.methods:
            for count in self.counts:
                yield name, count, self.completions_by(name, scene_views, count)

    @torch.no_grad()
    def completions_by(self, name: str, scene_views: SceneInViews, count: int) -> list[Completion]:
        """Different scenes that one method makes of the first views."""
        views = [batch.partial for batch in scene_views.batches[:count]]
        generator = torch.Generator().manual_seed(scene_views.codes)
        scenes = self.methods[name].complete_views(views, self.grid, self.samples, generator)
        return list({id(scene): scene for scene in scenes}.values())

    @torch.no_grad()
    def score(self, row: int) -> SceneScores:
        """All methods on all numbers of views of one scene."""
        scene_views = self.see(row)
        first = scene_views.batches[0]
        true = first.volumes.tsdf[0, 0]
        surfaces = Surfaces.of(true, self.grid, camera_of(first.cameras, 0), self.visible)
        truth = self.surfaces.truth(surfaces, rng.generator(self.seed, _POINTS, row))
        scores: dict[str, dict[int, dict[str, float]]] = {}
        for name, count, scenes in self.completions(scene_views):
            of = _POINTS, row, rng.number_of(name), count
            sample_scores = [
                self._scores(scene, first, truth, rng.generator(self.seed, *of, draw))
                for draw, scene in enumerate(scenes)
            ]
            means = {
                key: float(np.mean([sample[key] for sample in sample_scores]))
                for key in sample_scores[0]
            }
            scores.setdefault(name, {})[count] = means
        return SceneScores(scene_views.index, truth.floors["chamfer_full"], scores)

    def _scores(
        self, scene: Completion, batch: ViewBatch, truth: TruePoints, points: np.random.Generator
    ) -> dict[str, float]:
        full = surface(scene.tsdf[0], self.grid)
        shape = None if full is None else Surfaces(full, None)
        surface_scores = self.surfaces.compare(shape, truth, points)
        labels = instance_scores(
            scene.instances[0].cpu().numpy(),
            batch.volumes.instances[0].cpu().numpy(),
            self.matching,
        )
        occupied = batch.volumes.tsdf[0, 0].cpu().numpy() < 0
        return {
            "chamfer_full": surface_scores["chamfer_full"],
            "excess": surface_scores["chamfer_full_dense"] - truth.floors["chamfer_full_dense"],
            "fscore_1cm": surface_scores[self.surfaces.f_score_name],
            "occupancy_iou": occupancy_iou(scene.tsdf[0].cpu().numpy() < 0, occupied),
            "instance_iou": labels.iou,
            "count_error": labels.count_error,
        }
