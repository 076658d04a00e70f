"""Data of decoders of sets as torch tensors: views, and the superquadrics that queries give.

torch is imported for type checkers only, so that these can be named without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import SceneParameters
    from scenefw.core.types import GridSpec

VOLUME, IMAGE = "volume", "image"
"""What networks of sets see of a view: a voxel grid, or a small image of places."""


@dataclass(frozen=True)
class ObjectQueryBatch:
    """B views of superquadrics: what each shows, points that are seen, what is there.

    All places, objects too, are in one frame: the world for volumes, and for images that of the
    view (z up from the floor, x level and away from the camera; `data.batches.set_inputs`).

    Args:
        condition: what the encoder sees: volumes (B, 2, X, Y, Z) as in `ShapeInstanceBatch`, or
            images (B, 11, H, W) of `place_image`.
        points: (B, P, 3) m, of what is seen above the floor; any where there is none. For images
            one of each cell of 4 x 4 pixels, row by row.
        seen: (B, P) bool: points that count.
        scenes: the objects, up to M.
        places: (B, M, Q, 3) m: points about each object, the first half near its surface.
        distances: (B, M, Q) m, signed distances to it there, along rays from its centre.
    """

    condition: Tensor
    points: Tensor
    seen: Tensor
    scenes: SceneParameters
    places: Tensor
    distances: Tensor


@dataclass(frozen=True)
class QueriedSet:
    """Superquadrics that N queries give for each of B views.

    Args:
        existence: (B, N) logits that there is such an object.
        half_axes: (B, N, 3) m.
        exponents: (B, N, 3).
        rotations: (B, N, 3, 3), object to world.
        positions: (B, N, 3) m.
        active: (B, N) bool: queries that count; a view that shows little has fewer.
        starts: (B, N, 3) m: where queries start, most of them on a seen surface.
        matched: (B, N) int64, the true object that each stands for, -1 = none; None before they
            are matched.
        owned: (B, N) int64, the true object at whose surface each starts, -1 = none; None: not
            looked for.
    """

    existence: Tensor
    half_axes: Tensor
    exponents: Tensor
    rotations: Tensor
    positions: Tensor
    active: Tensor
    starts: Tensor
    matched: Tensor | None = None
    owned: Tensor | None = None


@dataclass(frozen=True)
class ObjectQueryPrediction:
    """What a decoder of sets predicts for B views.

    Args:
        layers: a set of each of its layers; the last one is the answer.
        denoised: sets of each layer that began at true objects with noise, matched; in training.
    """

    layers: Sequence[QueriedSet]
    denoised: Sequence[QueriedSet] = ()

    @property
    def taught(self) -> list[QueriedSet]:
        """All sets from which losses are made."""
        return [*self.layers, *self.denoised]


@dataclass(frozen=True)
class ObjectQuerySetup:
    """What losses may check before a training of a decoder of sets starts.

    Args:
        grid: the voxel grid of views.
        queries: objects that the network predicts.
    """

    grid: GridSpec
    queries: int
