"""Shape and instances from one view, by visibility (thesis table 5.1, figs 5.24, 5.25)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from itertools import product
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from scenefw.core.errors import ConfigError
from scenefw.core.protocols import (
    InstanceExtractor,
    MappingMethod,
    Matching,
    Noise,
    Reconstructor,
    SurfaceRenderer,
    Track,
    Workers,
)
from scenefw.core.settings import COUNT
from scenefw.core.types import Camera, Float64, GridSpec
from scenefw.data.batches.stacks import SceneSet
from scenefw.data.batches.views import ViewBatch, ViewMaker, Viewpoints
from scenefw.evaluation.kept_rows import KeptRows, kept_or_made
from scenefw.evaluation.scored_scenes import workers_on
from scenefw.evaluation.side_by_side import collected, run_single_threaded, side_by_side
from scenefw.evaluation.stacks.draw_results import DrawsResult, DrawView
from scenefw.evaluation.stacks.draws import DrawScoring, Truth
from scenefw.evaluation.stacks.methods import BASE_RATE, TRAINING_MEAN
from scenefw.evaluation.stacks.published import published_of
from scenefw.evaluation.stacks.results import ReconstructionResult, ViewScores
from scenefw.evaluation.stacks.seen_scenes import Sample, SceneViews, SeenScene, Streams
from scenefw.evaluation.stacks.surface_scores import Surfaces, SurfaceScoring, TruePoints
from scenefw.evaluation.stacks.training_mean import TrainingMean
from scenefw.evaluation.stacks.visibility import VisibleSurface, shown_pixels
from scenefw.metrics.instances import instance_scores, object_ious
from scenefw.metrics.occupancy import (
    binary_cross_entropy,
    coverage,
    expected_occupancy,
    occupancy_iou,
    probable_occupancy,
)
from scenefw.perception.completion.partial_surface import instances_of

Item = TypeVar("Item")
Result = TypeVar("Result")

_TEST, _CALIBRATION = Streams(1, 2, 3), Streams(11, 12, 13)


class ReconstructionEvaluation:
    """Scores methods on random views of test scenes, all on the same views.

    Every scene is seen from `views` random cameras; every method makes `samples` scenes of each
    view. A view's score is the mean over its samples, so that means and sigmas are over views. The
    surface of a scene is that of its true TSDF on the finest grid of all methods; volumes are
    compared on each method's own grid.

    Args:
        scenes: of the test split.
        methods: by name; the first is the main one. A method with a grid is given views on it. None
            leaves one out.
        viewpoints: draws cameras.
        renderer: makes depth images of the true TSDF, and of all TSDFs for what is visible.
        mapping: from depth to partial TSDF.
        noise: disturbs the depth images.
        extractors: by name, other ways from the main method's shapes to instances.
        grid: for methods that have no grid of their own, if none has.
        views: cameras per scene.
        samples: latent samples per view.
        surfaces: Chamfer distances and what else compares surfaces.
        matching: of predicted to true objects.
        seed: of cameras, noise, codes and points.
        device: where volumes and views are computed.
        draws: judges samples as samples, and knows the forecasts without an image; or None.
        workers: views at once; None: on the CPU as many as torch has threads, on a GPU one.
        parallel: processes that score views, each on its own; None: threads of this one.
        published: data set of table 5.1 whose figures stand beside these: `superquadrics`, `ycb`,
            or None.
        kept: finished views of an interrupted run, where samples aren't judged; None keeps none.
        mean: forecasts of occupancy without an image, to stand beside; None: that of `draws`.

    Raises:
        ConfigError: no method, no worker, no grid, or no such data set.
    """

    def __init__(
        self,
        scenes: SceneSet,
        methods: Mapping[str, Reconstructor | None],
        viewpoints: Viewpoints,
        renderer: SurfaceRenderer,
        mapping: MappingMethod,
        noise: Mapping[str, Noise] | None = None,
        extractors: Mapping[str, InstanceExtractor | None] | None = None,
        grid: GridSpec | None = None,
        views: int = 3,
        samples: int = 3,
        surfaces: SurfaceScoring | None = None,
        matching: Matching | None = None,
        seed: int = 0,
        device: str = "cpu",
        draws: DrawScoring | None = None,
        workers: int | None = None,
        parallel: Workers | None = None,
        published: str | None = "superquadrics",
        kept: KeptRows | None = None,
        mean: TrainingMean | None = None,
    ) -> None:
        published_of(published)
        self.published, self.kept = published, kept
        COUNT.require(workers=workers, views=views, samples=samples)
        self.workers = workers_on(device, workers)
        self.parallel = parallel
        self.methods = {name: method for name, method in methods.items() if method is not None}
        if not self.methods:
            raise ConfigError("no method to evaluate; leave one of evaluation.methods in")
        self.scenes = scenes
        self.extractors = {
            name: extractor
            for name, extractor in (extractors or {}).items()
            if extractor is not None
        }
        self.draws = draws
        self.mean = mean or (draws.mean if draws else None)
        draw_methods = draws.methods if draws else {}
        self.grids = _grids({**self.methods, **draw_methods}, grid)
        makers = {
            g: ViewMaker(g, viewpoints, renderer, mapping, noise)
            for g in dict.fromkeys(self.grids.values())
        }
        self.views = views
        self.samples = samples
        self.surfaces = surfaces or SurfaceScoring()
        self.renderer, self.visible = renderer, VisibleSurface(renderer)
        self.matching = matching
        self.seed = seed
        self.seeing = SceneViews(makers, self.visible, seed, device)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all rows: methods, other ways to instances, forecasts without an image."""
        blind = () if self.mean is None else (BASE_RATE, TRAINING_MEAN)
        return (*self.methods, *self.extractors, *blind)

    def run(self, track: Track = lambda pairs, _: pairs) -> ReconstructionResult:
        """Scores all views; `track(items, what)` shows a bar of the loop."""
        calibration = self._calibration(track)
        pairs = list(product(range(len(self.scenes)), range(self.views)))
        if self.draws is None:
            return self._without_draws(pairs, track)
        results = self._map_views(lambda pair: self._score_view(*pair), pairs, track, "test views")
        views = [scores for scores, _ in results]
        draw_views = [outcome for _, outcome in results if outcome]
        methods = (*self.methods, *self.draws.methods)
        draws = DrawsResult(tuple(draw_views), calibration, methods, self.draws.count)
        return ReconstructionResult(
            tuple(views), self.names, self.samples, self.seed, draws, self.published
        )

    def _without_draws(self, pairs: list[tuple[int, int]], track: Track) -> ReconstructionResult:
        """Scores alone; what an interrupted run has found is used again."""
        views = kept_or_made(
            self.kept,
            {f"{scene}/{view}": (scene, view) for scene, view in pairs},
            lambda items, on_result: self._map_views(
                lambda pair: self.score(*pair), items, track, "test views", on_result
            ),
            asdict,
            ViewScores.restored,
        )
        return ReconstructionResult(
            tuple(views), self.names, self.samples, self.seed, published=self.published
        )

    def score(self, scene: int, view: int) -> ViewScores:
        """All methods on one view of one scene of the split."""
        return self._score_view(scene, view)[0]

    @torch.no_grad()
    def _score_view(self, scene: int, view: int) -> tuple[ViewScores, DrawView | None]:
        """Scores of a view and, of the first scenes, what all samples are worth together."""
        scene_view = self.seeing.see(self.scenes, scene, view, _TEST)
        truth = self.surfaces.truth(scene_view.surfaces, scene_view.points)
        draws = self.draws if self.draws and scene < self.draws.scenes else None
        samples = self._samples(scene_view, max(self.samples, draws.count if draws else 0))
        outcome = self._judge_draws(draws, scene_view, samples, truth.visible) if draws else None
        first = {name: pairs[: self.samples] for name, pairs in samples.items()}
        return self._scores(scene_view, first, truth), outcome

    def _scores(
        self, scene_view: SeenScene, samples: Mapping[str, list[Sample]], truth: TruePoints
    ) -> ViewScores:
        scores, objects = {}, {}
        true = scene_view.batches[scene_view.finest]
        pixels = shown_pixels(self.renderer, true.volumes, scene_view.finest, true.cameras)
        for name, pairs in samples.items():
            grid, main = self.grids[name], name == next(iter(samples))
            batch = scene_view.batches[grid]
            scores[name] = self._volume_scores(pairs, batch, grid)
            ious = self._object_ious([instances for _, instances in pairs], batch)
            objects[name] = tuple(ious.get(label, 0.0) for label in pixels)
            surfaces = [self._surfaces(tsdf, grid, scene_view.camera) for tsdf, _ in pairs]
            shapes = [
                self.surfaces.compare(predicted, truth, scene_view.points_of(name, draw))
                for draw, predicted in enumerate(surfaces)
            ]
            scores[name] |= _means(shapes)
            if main:
                scores |= self._relabelled(pairs, batch, grid) | self._without_image(batch, grid)
        return ViewScores(
            scene_view.index,
            scene_view.view,
            truth.visibility,
            truth.floors,
            scores,
            tuple(pixels.values()),
            objects,
        )

    def _calibration(self, track: Track) -> tuple[DrawView, ...]:
        """Outcomes of samples of validation scenes."""
        if self.draws is None:
            return ()
        draws, rows = self.draws, range(len(self.draws.calibration))
        return tuple(
            self._map_views(
                lambda row: self._calibrated(draws, row), rows, track, "calibration views"
            )
        )

    def _map_views(
        self,
        work: Callable[[Item], Result],
        items: Sequence[Item],
        track: Track,
        title: str,
        on_result: Callable[[Item, Result], None] = lambda *_: None,
    ) -> list[Result]:
        """Results of views, in their order."""
        if self.parallel is None:
            return side_by_side(work, items, track, title, self.workers, on_result)
        results = self.parallel.each(partial(run_single_threaded, work), items)
        return collected(results, items, track, title, on_result)

    @torch.no_grad()
    def _calibrated(self, draws: DrawScoring, row: int) -> DrawView:
        scene_view = self.seeing.see(draws.calibration, row, 0, _CALIBRATION)
        samples = self._samples(scene_view, draws.count)
        return self._judge_draws(
            draws, scene_view, samples, scene_view.visible_points(), surfaces=False
        )

    def _samples(self, scene_view: SeenScene, count: int) -> dict[str, list[Sample]]:
        return {
            name: scene_view.samples(method, self.grids[name], count)
            for name, method in self.methods.items()
        }

    def _judge_draws(
        self,
        draws: DrawScoring,
        scene_view: SeenScene,
        samples: Mapping[str, list[Sample]],
        visible: Float64,
        *,
        surfaces: bool = True,
    ) -> DrawView:
        """Outcomes of samples; `visible` are points on the visible surface of the truth.

        Without `surfaces` no Chamfer distances are computed.
        """
        further_samples = {
            name: scene_view.samples(method, self.grids[name], draws.count)
            for name, method in draws.methods.items()
        }
        truths: dict[GridSpec, Truth] = {}
        outcomes = {}
        for name, pairs in {**samples, **further_samples}.items():
            grid = self.grids[name]
            if grid not in truths:
                truths[grid] = scene_view.truth(grid, visible)
            selection = pairs[: draws.count]
            chamfers = [
                self.surfaces.visible(
                    self._surfaces(tsdf, grid, scene_view.camera),
                    visible,
                    scene_view.points_of(name, draw),
                )
                for draw, (tsdf, _) in enumerate(selection if surfaces else ())
            ]
            outcomes[name] = draws.judge(selection, truths[grid], chamfers)
        return DrawView(scene_view.index, outcomes)

    def _surfaces(self, tsdf: Tensor, grid: GridSpec, camera: Camera) -> Surfaces | None:
        return Surfaces.of(tsdf, grid, camera, self.visible)

    def _volume_scores(
        self, pairs: Sequence[Sample], batch: ViewBatch, grid: GridSpec
    ) -> dict[str, float]:
        shapes = np.stack([tsdf.cpu().numpy() for tsdf, _ in pairs])
        truth = batch.volumes.tsdf[0, 0].cpu().numpy()
        occupied = truth < 0
        hidden = ~batch.partial.observed[0, 0].cpu().numpy() & (abs(truth) < grid.truncation)
        soft = probable_occupancy(shapes, grid.voxel_size / 2)
        return {
            "occupancy_bce": binary_cross_entropy(expected_occupancy(shapes), occupied),
            "occupancy_bce_probability": binary_cross_entropy(soft, occupied),
            "occupancy_iou": float(np.mean([occupancy_iou(s < 0, occupied) for s in shapes])),
            "hidden_coverage": coverage(shapes, truth, hidden),
            **self._instance_scores([instances for _, instances in pairs], batch),
        }

    def _object_ious(self, samples: Sequence[Tensor], batch: ViewBatch) -> dict[int, float]:
        """Mean over samples of each true object's IoU, by its label."""
        true = batch.volumes.instances[0].cpu().numpy()
        rows = [object_ious(instances.cpu().numpy(), true, self.matching) for instances in samples]
        return {label: float(np.mean([row[label] for row in rows])) for label in rows[0]}

    def _instance_scores(self, samples: Sequence[Tensor], batch: ViewBatch) -> dict[str, float]:
        true = batch.volumes.instances[0].cpu().numpy()
        rows = [instance_scores(labels.cpu().numpy(), true, self.matching) for labels in samples]
        return _means(
            [
                {
                    "instance_iou": row.iou,
                    "panoptic_quality": row.panoptic_quality,
                    "instance_recall": row.recall,
                    "count_error": row.count_error,
                    "count_excess": row.excess,
                }
                for row in rows
            ]
        )

    def _without_image(self, batch: ViewBatch, grid: GridSpec) -> dict[str, dict[str, float]]:
        """Cross entropies of forecasts that don't look at the view."""
        if self.mean is None:
            return {}
        occupied = batch.volumes.tsdf[0, 0].cpu().numpy() < 0
        mean = self.mean
        forecasts = {
            BASE_RATE: np.full(grid.shape, mean.rate(grid)),
            TRAINING_MEAN: mean.probability(grid),
        }
        return {
            name: {"occupancy_bce": binary_cross_entropy(forecast, occupied)}
            for name, forecast in forecasts.items()
        }

    def _relabelled(
        self, pairs: Sequence[Sample], batch: ViewBatch, grid: GridSpec
    ) -> dict[str, dict[str, float]]:
        """Instances that other extractors find in the same shapes, without votes."""
        shapes = [tsdf for tsdf, _ in pairs]
        return {
            name: self._instance_scores(
                [instances_of(tsdf, extractor, grid) for tsdf in shapes], batch
            )
            for name, extractor in self.extractors.items()
        }


def _grids(methods: Mapping[str, Reconstructor], default: GridSpec | None) -> dict[str, GridSpec]:
    """The grid of each method: its own, else that of the first method that has one."""
    grids = {name: method.grid for name, method in methods.items()}
    common = next((grid for grid in grids.values() if grid is not None), default)
    if common is None:
        raise ConfigError("no method has its own grid; give evaluation.grid=${grid}")
    return {name: grid or common for name, grid in grids.items()}


def _means(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
