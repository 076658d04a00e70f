"""Seen objects in the frame of their view, as flows of sets take them."""

from __future__ import annotations

import torch
from torch import Tensor

from scenefw.core.batches import SceneParameters
from scenefw.core.set_flows import SetFlowBatch


def view_frame(points: Tensor, visible: Tensor, eye: Tensor) -> tuple[Tensor, Tensor]:
    """Rotation (B, 3, 3) from the world to the frame of a view, and its origin (B, 3).

    Args:
        points: (B, N, P, 3) of seen objects, world (m).
        visible: (B, N) which objects count; with none the world's origin is taken.
        eye: (B, 3) where the camera is (m).
    """
    weights = visible.float()[..., None]
    middle = (points.mean(dim=2) * weights).sum(dim=1) / weights.sum(dim=1).clamp_min(1)
    origin = torch.stack([middle[:, 0], middle[:, 1], torch.zeros_like(middle[:, 0])], dim=-1)
    ahead = origin - eye
    x = torch.nn.functional.normalize(ahead[:, :2], dim=-1)
    zero, unit = torch.zeros_like(x[:, 0]), torch.ones_like(x[:, 0])
    rows = [
        torch.stack([x[:, 0], x[:, 1], zero], dim=-1),
        torch.stack([-x[:, 1], x[:, 0], zero], dim=-1),
        torch.stack([zero, zero, unit], dim=-1),
    ]
    return torch.stack(rows, dim=1), origin


def in_frame(
    points: Tensor,
    visible: Tensor,
    sizes: Tensor,
    ends: Tensor,
    eye: Tensor,
    scenes: SceneParameters,
) -> SetFlowBatch:
    """A batch in the frames of its views.

    Args:
        points: (B, N, P, 3) of each object, world (m).
        visible: (B, N) which objects count.
        sizes: (B, N) share of the image of each.
        ends: (B, N, E, 7) of `object_ends`.
        eye: (B, 3) where cameras are (m).
        scenes: what the objects are.
    """
    turn, origin = view_frame(points, visible, eye)
    local = torch.einsum("bij,bnpj->bnpi", turn, points - origin[:, None, None])
    end_mask = ends.any(dim=-1, keepdim=True)
    where = torch.einsum("bij,bnpj->bnpi", turn, ends[..., :3] - origin[:, None, None])
    outward = torch.einsum("bij,bnpj->bnpi", turn, ends[..., 3:6])
    turned = torch.cat([where, outward, ends[..., 6:]], dim=-1)
    return SetFlowBatch(
        torch.where(visible[..., None, None], local, 0.0),
        visible & scenes.present,
        sizes,
        torch.where(end_mask & visible[..., None, None], turned, 0.0),
        torch.einsum("bij,bj->bi", turn, eye - origin),
        scenes.half_axes,
        scenes.exponents,
        torch.einsum("bij,bnjk->bnik", turn, scenes.rotations),
        torch.einsum("bij,bnj->bni", turn, scenes.positions - origin[:, None]),
        scenes.present,
    )
