"""Scenes of superquadrics that a trained decoder of sets predicts, refined on the image."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from scenefw.core.settings import POSITIVE
from scenefw.data.batches.visible_points import LOWEST
from scenefw.fitting.placed import signed_distance
from scenefw.perception.completion.queried_objects import QueryDecoding
from scenefw.perception.observation.observation import JointGeometry
from scenefw.perception.steps import Objects, ObjectSet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.query_protocols import ObjectQueryModel
    from scenefw.core.training_protocols import TrainedOnGrid
    from scenefw.core.types import Float64, Int32
    from scenefw.perception.completion.refinement import SetRefinement
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.steps import Fits


class ObjectQuerySampling:
    """Predicts sets of superquadrics from views (group `reconstructor`).

    A pixel shows the object whose surface is nearest, if that is near. With `refinement`, objects
    are fitted again to what is seen of them; without it they are as predicted. There is one sample:
    nothing is drawn.

    Args:
        checkpoint: of a decoder of sets; its grid is the grid of everything here.
        refinement: fits objects to the image; None leaves them as predicted.
        min_existence: how sure the network must be that there is an object (0 to 1).
        max_shared_ratio: share of an object's room that a surer one may have.
        max_distance: a pixel shows an object whose surface is this near (m).

    Raises:
        ConfigError: a share outside 0..1, or a distance that isn't positive.
    """

    def __init__(
        self,
        checkpoint: TrainedOnGrid[ObjectQueryModel],
        refinement: SetRefinement | None = None,
        min_existence: float = 0.5,
        max_shared_ratio: float = 0.5,
        max_distance: float = 0.02,
    ) -> None:
        POSITIVE.require(max_distance=max_distance)
        self.queried = QueryDecoding(checkpoint, min_existence, max_shared_ratio)
        self.refinement, self.max_distance = refinement, max_distance
        self.grid = checkpoint.grid
        self.metadata: dict[str, Any] = dict(checkpoint.metadata)

    def complete(
        self, fits: Fits, view: Observation, samples: int, generator: torch.Generator
    ) -> list[ObjectSet]:
        """`samples` times the same complete scene; fits count for nothing.

        Raises:
            InputError: the view came without its image.
        """
        points = view.points
        (predicted,) = self.queried.of(view.partial, view.grid, generator)
        objects = Objects(owners(predicted, points, self.max_distance))
        shapes = dict(enumerate(predicted, 1))
        if self.refinement is not None:
            geometry = JointGeometry(points, view.grid, view.free, view.eye)  # no pixel is left out
            shapes = self.refinement.refined(shapes, objects, geometry)
        return [ObjectSet(objects, shapes)] * samples


def owners(objects: Sequence[FittedSuperquadric], points: Float64, max_distance: float) -> Int32:
    """Which object (H, W) a pixel shows, numbered from 1; 0 = none.

    Args:
        objects: the superquadrics.
        points: (H, W, 3) world (m), NaN where nothing is seen.
        max_distance: how near their surface must be (m).
    """
    masks = np.zeros(points.shape[:2], np.int32)
    above_floor = points[..., 2] > LOWEST  # False where nothing is seen
    if not objects or not above_floor.any():
        return masks
    gaps = np.stack([np.abs(signed_distance(item, points[above_floor])) for item in objects])
    masks[above_floor] = np.where(gaps.min(axis=0) < max_distance, gaps.argmin(axis=0) + 1, 0)
    return masks
