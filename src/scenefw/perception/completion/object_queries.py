"""Scenes of superquadrics that a trained decoder of sets predicts, refined on the image."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from scenefw.core.batches import Completion
from scenefw.core.settings import POSITIVE
from scenefw.data.seen_points import LOWEST
from scenefw.fitting.placed import signed_distance
from scenefw.perception.completion.queried_objects import QueriedObjects
from scenefw.perception.completion.superquadrics import with_superquadrics
from scenefw.perception.evidence.gathering import View, seen_free
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.view_frames import seen_frames

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.query_protocols import TrainedObjectQueries
    from scenefw.core.types import Float64, Frame, GridSpec, Int32
    from scenefw.perception.completion.refinement import RefinedSets
    from scenefw.postprocessing.confidence import Calibration


class ObjectQueryReconstructor:
    """Predicts sets of superquadrics from views (group `reconstructor`).

    A pixel shows the object whose surface is nearest, if that is near. With `refined`, objects are
    fitted again to what is seen of them; without it they are as predicted. There is one sample:
    nothing is drawn.

    Args:
        checkpoint: of a decoder of sets; its grid is the grid of everything here.
        refined: fits objects to the image; None leaves them as predicted.
        exists: how sure the network must be that there is an object (0 to 1).
        shared: share of an object's room that a surer one may have.
        own: a pixel shows an object whose surface is this near (m).

    Raises:
        ConfigError: a share outside 0..1, or a distance that isn't positive.
    """

    calibration: Calibration | None = None

    def __init__(
        self,
        checkpoint: TrainedObjectQueries,
        refined: RefinedSets | None = None,
        exists: float = 0.5,
        shared: float = 0.5,
        own: float = 0.02,
    ) -> None:
        POSITIVE.require(own=own)
        self.queried = QueriedObjects(checkpoint, exists, shared)
        self.refined, self.own = refined, own
        self.grid = checkpoint.grid
        self.metadata: dict[str, Any] = dict(checkpoint.metadata)

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """`samples` times the same complete scenes.

        Raises:
            InputError: the partial TSDF came without its depth images.
        """
        frames = seen_frames(partial, "a decoder of sets")
        free = seen_free(partial, grid)
        rows = self.queried.of(partial, grid, generator)
        views = [
            self._seen(found, frame, empty, grid)
            for found, frame, empty in zip(rows, frames, free, strict=True)
        ]
        device = partial.distance.device
        nothing = np.stack([view.tsdf for view, _ in views])
        scene = Completion(
            torch.from_numpy(nothing).to(device),
            torch.zeros(nothing.shape, dtype=torch.int32, device=device),
            masks=torch.from_numpy(np.stack([view.masks for view, _ in views])).to(device),
        )
        return [with_superquadrics(scene, views)] * samples

    def _seen(
        self, found: Sequence[FittedSuperquadric], frame: Frame, free: Any, grid: GridSpec
    ) -> tuple[View, dict[int, FittedSuperquadric]]:
        """A view of which nothing is predicted but masks, and its objects by label."""
        points = world_points(frame)
        masks = owners(found, points, self.own)
        nothing = np.full(grid.shape, grid.truncation, np.float32)
        labels = np.zeros(grid.shape, np.int32)
        eye = frame.camera.T_world_camera[:3, 3]
        view = View(points, masks, nothing, labels, free, grid, eye)
        objects = dict(enumerate(found, 1))
        return view, objects if self.refined is None else self.refined.refined(objects, view)


def owners(objects: Sequence[FittedSuperquadric], points: Float64, near: float) -> Int32:
    """Which object (H, W) a pixel shows, numbered from 1; 0 = none.

    Args:
        objects: the superquadrics.
        points: (H, W, 3) world (m), NaN where nothing is seen.
        near: how near their surface must be (m).
    """
    masks = np.zeros(points.shape[:2], np.int32)
    above = points[..., 2] > LOWEST  # False where nothing is seen
    if not objects or not above.any():
        return masks
    gaps = np.stack([np.abs(signed_distance(one, points[above])) for one in objects])
    masks[above] = np.where(gaps.min(axis=0) < near, gaps.argmin(axis=0) + 1, 0)
    return masks
