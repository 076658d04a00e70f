"""Data of decomposed scenes that crosses floors as torch tensors: sets of objects, predictions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.types import GridSpec


@dataclass(frozen=True)
class ObjectSetBatch:
    """B scenes as sets of objects, each with one view, in the units of the network.

    Args:
        condition: (B, 2, X, Y, Z), as in `ShapeInstanceBatch`.
        instances: (B, X, Y, Z) int32 on the same grid, 0 = no object, i + 1 = object i.
        present: (B, M) bool: objects that have a voxel; scenes with fewer are filled up.
        centres: (B, M, 3) centres of mass in the cube of the grid, each axis from -1 to 1.
    """

    condition: Tensor
    instances: Tensor
    present: Tensor
    centres: Tensor

    @property
    def occupancy(self) -> Tensor:
        """(B, 1, X, Y, Z) float: 1 inside any object, else 0."""
        return (self.instances > 0).to(self.condition.dtype)[:, None]


@dataclass(frozen=True)
class ObjectSetPrediction:
    """N objects predicted for each of B scenes.

    Args:
        logits: (B, N, X, Y, Z) of the occupancy of each object.
        codes: (B, N, C), what each object is decoded from.
        cells: (B, N) int64: which cells of the feature volume the codes were taken from.
        features: (B, C, S, S, S), that volume.
        existence: (B, N) logits that there is such an object, or None.
        centres: (B, N, 3) in the cube of the grid, each axis from -1 to 1, or None.
        boxes: (B, N, 2, 3) centres and half sides of boxes around the objects, in that cube, or
            None.
        partial: (B, 1, X, Y, Z) reconstruction of the condition's distances, or None.
        latent: (B, C, S, S, S) as drawn from the posterior, or None.
        divergence: (B,) nats of the posterior from the prior, or None.
        matched: (B, N) int64, the true object that each prediction stands for, -1 = none; None
            before they are matched.
    """

    logits: Tensor
    codes: Tensor
    cells: Tensor
    features: Tensor
    existence: Tensor | None = None
    centres: Tensor | None = None
    boxes: Tensor | None = None
    partial: Tensor | None = None
    latent: Tensor | None = None
    divergence: Tensor | None = None
    matched: Tensor | None = None


@dataclass(frozen=True)
class ObjectSetSetup:
    """What losses may check before a training on sets of objects starts.

    Args:
        grid: the voxel grid.
        slots: objects that the network predicts.
        gives: what it predicts beside shapes: existence, centres, boxes, partial, latent,
            divergence.
    """

    grid: GridSpec
    slots: int
    gives: frozenset[str]
