"""Data of flows of sets that crosses floors as torch tensors: what a view shows, predictions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class SetFlowBatch:
    """B views of superquadrics: points that are seen of each, and what each is.

    Coordinates are of the view's own frame: z up, z = 0 on the floor, the origin below the middle
    of what is seen, the camera above the negative x axis.

    Args:
        points: (B, N, P, 3) m, on the seen surface of each object; 0 for those that aren't seen.
        seen: (B, N) bool: objects of which enough is seen.
        sizes: (B, N) share of the image that each covers.
        ends: (B, N, E, 7) where its image ends: point (m), direction outward, and by how much what
            follows is further from the camera (m); all 0 for objects whose image has no end.
        camera: (B, 3) m, where the camera is; y = 0.
        half_axes: (B, N, 3) m.
        exponents: (B, N, 3).
        rotations: (B, N, 3, 3), object to view frame.
        positions: (B, N, 3) m.
        present: (B, N) bool; absent objects fill up the batch.
    """

    points: Tensor
    seen: Tensor
    sizes: Tensor
    ends: Tensor
    camera: Tensor
    half_axes: Tensor
    exponents: Tensor
    rotations: Tensor
    positions: Tensor
    present: Tensor


@dataclass(frozen=True)
class SetFlowPrediction:
    """What a flow between noise and sets predicts for B views.

    Args:
        velocity: (B, N, D) from noise to objects.
        target: (B, N, D), what it should be.
        present: (B, N) bool: objects that count.
        counts: (B, K) logits of the number of objects that aren't seen; None: it draws none.
        hidden: (B,) int64, their true number; None like `counts`.
    """

    velocity: Tensor
    target: Tensor
    present: Tensor
    counts: Tensor | None
    hidden: Tensor | None


@dataclass(frozen=True)
class SetFlowSetup:
    """What losses may check before a training of a flow of sets starts.

    Args:
        slots: objects of a scene at most.
        draws_hidden: the network draws objects of which nothing is seen.
    """

    slots: int
    draws_hidden: bool
