"""Shape and instances from one view, by visibility (thesis table 5.1, figs 5.24, 5.25)."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import torch
from torch import Tensor

from scenefw.core import rng
from scenefw.core.errors import ConfigError
from scenefw.core.protocols import (
    InstanceExtractor,
    MappingMethod,
    Matching,
    Noise,
    Reconstructor,
    Renderer,
    Track,
)
from scenefw.core.types import Camera, GridSpec
from scenefw.data.stacks import StackScenes
from scenefw.data.views import ViewBatch, ViewMaker, Viewpoints
from scenefw.evaluation.stacks.references import instances_of
from scenefw.evaluation.stacks.results import ReconstructionResult, ViewScores
from scenefw.evaluation.stacks.surface_scores import Surfaces, SurfaceScoring
from scenefw.evaluation.stacks.visibility import VisibleSurface, camera_of
from scenefw.metrics.instances import instance_scores
from scenefw.metrics.occupancy import (
    binary_cross_entropy,
    coverage,
    expected_occupancy,
    occupancy_iou,
    probable_occupancy,
)

Sample = tuple[Tensor, Tensor]

_VIEW_STREAM, _POINT_STREAM, _CODE_STREAM = 1, 2, 3


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

    Raises:
        ConfigError: no method, or no grid.
    """

    def __init__(
        self,
        scenes: StackScenes,
        methods: Mapping[str, Reconstructor | None],
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        noise: Mapping[str, Noise] | None = None,
        extractors: Mapping[str, InstanceExtractor] | None = None,
        grid: GridSpec | None = None,
        views: int = 3,
        samples: int = 3,
        surfaces: SurfaceScoring | None = None,
        matching: Matching | None = None,
        seed: int = 0,
        device: str = "cpu",
    ) -> None:
        self.methods = {name: method for name, method in methods.items() if method is not None}
        if not self.methods or views < 1 or samples < 1:
            raise ConfigError(
                f"evaluation needs methods, views and samples, got {len(self.methods)}, {views} "
                f"and {samples}; expected at least 1 of each"
            )
        self.scenes = scenes
        self.extractors = dict(extractors or {})
        self.grids = _grids(self.methods, grid)
        self.makers = {
            g: ViewMaker(g, viewpoints, renderer, mapping, noise)
            for g in dict.fromkeys(self.grids.values())
        }
        self.views = views
        self.samples = samples
        self.surfaces = surfaces or SurfaceScoring()
        self.visible = VisibleSurface(renderer)
        self.matching = matching
        self.seed = seed
        self.device = device

    @torch.no_grad()
    def run(self, track: Track = lambda pairs, _: pairs) -> ReconstructionResult:
        """Scores all views; `track(items, what)` shows a bar of the loop."""
        pairs = list(product(range(len(self.scenes)), range(self.views)))
        scores = tuple(self.score(scene, view) for scene, view in track(pairs, "test views"))
        names = (*self.methods, *self.extractors)
        return ReconstructionResult(scores, names, self.samples, self.seed)

    def score(self, scene: int, view: int) -> ViewScores:
        """All methods on one view of one scene of the split."""
        parameters = self.scenes.parameters([scene], self.device)
        batches = {
            grid: maker.make_one(parameters, rng.generator(self.seed, _VIEW_STREAM, scene, view))
            for grid, maker in self.makers.items()
        }
        finest = max(self.makers, key=lambda grid: grid.resolution)
        camera = camera_of(batches[finest].cameras, 0)
        points = rng.generator(self.seed, _POINT_STREAM, scene, view)
        truth = self.surfaces.truth(
            self._surfaces(batches[finest].volumes.tsdf[0, 0], finest, camera), points
        )
        scores = {}
        for name, method in self.methods.items():
            grid, codes = self.grids[name], torch.Generator()
            codes.manual_seed(rng.torch_seed(self.seed, _CODE_STREAM, scene, view))
            samples = method.reconstruct(batches[grid].partial, grid, self.samples, codes)
            pairs = [(tsdf[0], instances[0]) for tsdf, instances in samples]
            scores[name] = self._volume_scores(pairs, batches[grid], grid)
            shapes = [
                self.surfaces.compare(self._surfaces(tsdf, grid, camera), truth, points)
                for tsdf in _distinct([tsdf for tsdf, _ in pairs])
            ]
            scores[name] |= _means(shapes)
            if name == next(iter(self.methods)):
                scores |= self._relabelled(pairs, batches[grid], grid)
        return ViewScores(
            int(self.scenes.indices[scene]), view, truth.visibility, truth.floors, scores
        )

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

    def _instance_scores(self, samples: Sequence[Tensor], batch: ViewBatch) -> dict[str, float]:
        true = batch.volumes.instances[0].cpu().numpy()
        rows = [
            instance_scores(labels.cpu().numpy(), true, self.matching)
            for labels in _distinct(samples)
        ]
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

    def _relabelled(
        self, pairs: Sequence[Sample], batch: ViewBatch, grid: GridSpec
    ) -> dict[str, dict[str, float]]:
        """Instances that other extractors find in the same shapes, without votes."""
        shapes = _distinct([tsdf for tsdf, _ in pairs])
        return {
            name: self._instance_scores(
                [instances_of(tsdf[None], extractor, grid)[0] for tsdf in shapes], batch
            )
            for name, extractor in self.extractors.items()
        }


def _grids(methods: Mapping[str, Reconstructor], default: GridSpec | None) -> dict[str, GridSpec]:
    """The grid of each method: its own, else that of the first method that has one."""
    own = {name: method.grid for name, method in methods.items()}
    common = next((grid for grid in own.values() if grid is not None), default)
    if common is None:
        raise ConfigError("no method has its own grid; give evaluation.grid=${grid}")
    return {name: grid or common for name, grid in own.items()}


def _distinct(samples: Sequence[Tensor]) -> list[Tensor]:
    """One of all if a method without randomness repeats the same result, else all."""
    first = samples[0]
    same = all(s.data_ptr() == first.data_ptr() and s.shape == first.shape for s in samples)
    return [first] if same else list(samples)


def _means(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
