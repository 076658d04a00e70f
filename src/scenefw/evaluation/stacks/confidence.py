"""Whether predictions are as sure of objects as they are right about them."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.errors import ConfigError
from scenefw.data.batches.views import ViewMaker, Viewpoints
from scenefw.evaluation.kept_rows import KeptRows
from scenefw.evaluation.scored_scenes import scored_scenes, workers_on
from scenefw.evaluation.stacks.confidence_results import ConfidenceResult, ObjectConfidence
from scenefw.evaluation.stacks.several_views import SeenOften
from scenefw.postprocessing.confidence import best_overlaps, confidences

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenefw.core.protocols import MappingMethod, Noise, Renderer, Track
    from scenefw.core.types import GridSpec
    from scenefw.data.batches.stacks import SceneSet
    from scenefw.perception.pipeline import ReconstructionPipeline

_VIEWS, _CODES = 41, 42  # random streams


class ConfidenceEvaluation:
    """Compares how alike samples of one view are, object by object, with the IoU with the truth.

    Agreement is the confidence of `run=predict` without a calibration. Beside it stand the
    calibration that predictions have, one that is fitted to the other half of the scenes, and a
    constant, the mean IoU of that half.

    Args:
        scenes: of a split.
        method: reconstructs views.
        viewpoints: draws cameras.
        renderer: makes depth images of the true TSDF.
        mapping: from depth to partial TSDF.
        noise: disturbs the depth images.
        samples: of each view.
        seed: of cameras, noise and samples.
        device: where volumes and views are computed.
        workers: scenes at once; None: on the CPU as many as torch has threads, on a GPU one.
        kept: finished scenes of an interrupted run; None keeps none.

    Raises:
        ConfigError: fewer than two samples, or the method has no grid.
    """

    def __init__(
        self,
        scenes: SceneSet,
        method: ReconstructionPipeline,
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        noise: Mapping[str, Noise] | None = None,
        samples: int = 3,
        seed: int = 0,
        device: str = "cpu",
        workers: int | None = None,
        kept: KeptRows | None = None,
    ) -> None:
        if samples < 2:
            raise ConfigError(f"size.samples is {samples}: agreement needs 2 samples or more")
        if method.grid is None:
            raise ConfigError("the method has no grid; give evaluation.method.grid")
        self.scenes, self.method, self.samples = scenes, method, samples
        self.grid: GridSpec = method.grid
        self.maker = ViewMaker(method.grid, viewpoints, renderer, mapping, noise)
        self.seed, self.device, self.kept = seed, device, kept
        self.workers = workers_on(device, workers)

    def run(self, track: Track = lambda items, _: items) -> ConfidenceResult:
        """Scores all scenes; `track(items, what)` shows a bar of the loop."""
        scene_objects = scored_scenes(
            self.score,
            len(self.scenes),
            lambda rows: [ObjectConfidence(**row) for row in rows],
            track,
            self.kept,
            self.workers,
            packed=lambda objects: [asdict(item) for item in objects],
        )
        objects = tuple(item for scene in scene_objects for item in scene)
        return ConfidenceResult(objects, self.samples, self.method.calibration)

    @torch.no_grad()
    def score(self, row: int) -> list[ObjectConfidence]:
        """All objects that are predicted of one view of a scene."""
        streams = (self.seed, _VIEWS, _CODES)
        scene_views = SeenOften.of(self.scenes, row, self.maker, 1, streams, self.device)
        batch = scene_views.batches[0]
        generator = torch.Generator().manual_seed(scene_views.codes)
        first, *further_samples = self.method.complete(
            batch.partial, self.grid, self.samples, generator
        )
        agreements = confidences(
            first.instances[0], [sample.instances[0] for sample in further_samples]
        )
        if not agreements:
            return []
        labels = first.instances[0].cpu().numpy().astype(np.int64)
        true = batch.volumes.instances[0].cpu().numpy().astype(np.int64)
        overlaps = best_overlaps(labels, np.array(list(agreements)), true)
        return [
            ObjectConfidence(scene_views.index, agreement, float(iou))
            for agreement, iou in zip(agreements.values(), overlaps, strict=True)
        ]
