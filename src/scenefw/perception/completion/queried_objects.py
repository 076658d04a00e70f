"""Superquadrics that a trained decoder of sets sees in a view."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core import geometry
from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.queried_sets import IMAGE
from scenefw.core.settings import PART, PROBABILITY
from scenefw.core.types import Pose
from scenefw.data.batches.set_inputs import image_view, volume_view
from scenefw.data.batches.view_samples import points_of_view, width_of_view
from scenefw.fitting.placed import in_frame_of, shape_of

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.queried_sets import QueriedSet
    from scenefw.core.query_protocols import ObjectQueryModel
    from scenefw.core.training_protocols import TrainedOnGrid
    from scenefw.core.types import GridSpec
    from scenefw.data.batches.set_inputs import SetView

_CORNERS = 6  # of meshes that say where an object is
_SHELLS = (1.0, 0.7, 0.4, 0.1)  # of sizes: so its inner points are spread


class QueryDecoding:
    """Asks a network for the objects of views, and leaves out those that it is not sure of.

    Several queries may find one object. So of two that share much of their room, the surer stays.

    Args:
        checkpoint: of a decoder of sets.
        min_existence: how sure the network must be that there is an object (0 to 1).
        max_shared_ratio: share of an object's room that a surer one may have.

    Raises:
        ConfigError: a share outside 0..1.
    """

    def __init__(
        self,
        checkpoint: TrainedOnGrid[ObjectQueryModel],
        min_existence: float = 0.5,
        max_shared_ratio: float = 0.5,
    ) -> None:
        PROBABILITY.require(min_existence=min_existence)
        PART.require(max_shared_ratio=max_shared_ratio)
        self.model: ObjectQueryModel = checkpoint.model
        self.points = points_of_view(checkpoint.metadata)
        self.width = width_of_view(checkpoint.metadata)
        self.min_existence, self.max_shared_ratio = min_existence, max_shared_ratio

    @torch.no_grad()
    def of(
        self, partial: PartialTSDF, grid: GridSpec, generator: torch.Generator
    ) -> list[list[FittedSuperquadric]]:
        """Objects of each view, the surest first.

        Args:
            partial: with its images.
            grid: of the partial TSDFs.
            generator: says which points a network of volumes is shown, on the CPU.
        """
        view = self._view(partial, grid, generator)
        device = next(self.model.parameters()).device  # type: ignore[attr-defined]
        predictions = self.model.predict(*(tensor.to(device) for tensor in view[:3]))
        predictions = _in_world(predictions, view.turn.to(device), view.origin.to(device))
        return [self._confident_objects(predictions, row) for row in range(len(view.points))]

    def _view(self, partial: PartialTSDF, grid: GridSpec, generator: torch.Generator) -> SetView:
        """What the network sees of views."""
        if self.model.sees == IMAGE:
            return image_view(partial, grid, self.width)
        chances = torch.rand(len(partial.distance), self.points, generator=generator)
        return volume_view(partial, grid, chances)

    def _confident_objects(self, predictions: QueriedSet, row: int) -> list[FittedSuperquadric]:
        chances = predictions.existence[row].sigmoid().cpu()
        chances = torch.where(predictions.active[row].cpu(), chances, 0.0)
        order = [
            k for k in chances.argsort(descending=True).tolist() if chances[k] > self.min_existence
        ]
        objects: list[FittedSuperquadric] = []
        for k in order:
            candidate = _superquadric(predictions, row, k)
            if all(shared_room(candidate, item) <= self.max_shared_ratio for item in objects):
                objects.append(candidate)
        return objects


def shared_room(first: FittedSuperquadric, second: FittedSuperquadric) -> float:
    """Share of the smaller object that lies in the larger one, by points of its shells."""
    small, large = sorted((first, second), key=lambda item: shape_of(item).volume())
    corners = shape_of(small).mesh(_CORNERS).vertices
    inner = np.concatenate([share * corners for share in _SHELLS])
    places = inner @ small.pose.rotation.T + small.pose.position
    return float((shape_of(large).value(in_frame_of(large, places)) < 1).mean())


def _in_world(predictions: QueriedSet, turn: Tensor, origin: Tensor) -> QueriedSet:
    """Objects of frames, whose turns (B, 3, 3) are from the world, with origins (B, 3) m."""
    to_world = turn.transpose(-1, -2)
    return replace(
        predictions,
        rotations=torch.einsum("bij,bnjk->bnik", to_world, predictions.rotations),
        positions=torch.einsum("bij,bnj->bni", to_world, predictions.positions) + origin[:, None],
    )


def _superquadric(predictions: QueriedSet, row: int, query: int) -> FittedSuperquadric:
    axes, exponents, rotation, position = (
        tensor[row, query].double().cpu().numpy()
        for tensor in (
            predictions.half_axes,
            predictions.exponents,
            predictions.rotations,
            predictions.positions,
        )
    )
    pose = Pose(position, geometry.quaternion_from_rotation(rotation))
    return FittedSuperquadric(axes, exponents, pose, 0.0, np.empty(0))
