"""What is about a table: where it ends, the floor below it, and large things on that floor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch, SceneParameters
from scenefw.kernels.cameras import floor_depths, pixel_places
from scenefw.kernels.superquadric_rays import first_hits
from scenefw.kernels.transfer import to_device

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.rng import Streams

_EDGES, _THINGS = 2, 3  # of a table; about it
_DRAWS = 3 + 2 * _EDGES + 8 * _THINGS
_GAP = (0.01, 0.35)  # m, from objects to an edge
_DROP = (0.15, 0.8)  # m, from the table to the floor
_SECOND = 0.5  # share of tables with a second edge in view
_PRESENT, _SIZE = 0.5, (0.1, 0.45)  # share of things that are there; their half-axes (m)
_AWAY, _ASIDE = (0.05, 1.0), 0.8  # m, from the edge, and along it


@dataclass(frozen=True)
class _Table:
    """B tables: edges (B, E, 2) outward and how far along (B, E), how high (B,), drawn numbers."""

    outward: Tensor
    reach: Tensor
    height: Tensor
    things: Tensor


@torch.no_grad()
def surrounding_depths(
    scenes: SceneParameters,
    cameras: CameraBatch,
    streams: Streams,
    changed: NDArray[np.bool_],
) -> Tensor:
    """z-depth (B, H, W) of all that is no object on the table (m).

    A table ends in one or two straight edges, beyond all objects; further down is a floor, and
    large superquadrics stand on it, higher than the table or lower.

    Args:
        scenes: B of them; what a table has to carry.
        cameras: one for each.
        streams: one for each.
        changed: (B,) whose tables end; the others have a floor at z = 0 that goes on.
    """
    shape = (len(changed), cameras.height, cameras.width)
    depth = floor_depths(cameras).view(shape)
    if not changed.any():
        return depth
    numbers = streams.uniform(_DRAWS).astype(np.float32)
    draws, changed_mask = to_device([numbers, changed], depth.device)
    table = _drawn_table(scenes, draws)
    places = pixel_places(depth, cameras)[..., :2]
    along = torch.einsum("bhwc,bec->behw", places, table.outward)
    off_table = (along > table.reach[:, :, None, None]).any(dim=1) & changed_mask[:, None, None]
    above = cameras.T_world_camera[:, 2, 3]
    lower = depth * (1 + table.height / above)[:, None, None]
    depth = torch.where(off_table, lower, depth)
    things, _ = first_hits(_things(table, _middles(scenes), cameras, changed_mask), cameras)
    return torch.where((things > 0) & (things < depth), things, depth)


def _drawn_table(scenes: SceneParameters, draws: Tensor) -> _Table:
    first = 2 * np.pi * draws[:, 0]
    angles = torch.stack([first, first + np.pi * (0.25 + 0.5 * draws[:, 1])], dim=1)
    outward = torch.stack([angles.cos(), angles.sin()], dim=-1)
    # A box about an object reaches so far along a direction
    turned = torch.einsum("bec,bncj->benj", outward, scenes.rotations[:, :, :2])
    sides = (turned.abs() * scenes.half_axes[:, None]).sum(dim=-1)
    ends = torch.einsum("bec,bnc->ben", outward, scenes.positions[..., :2]) + sides
    ends = torch.where(scenes.present[:, None], ends, -torch.inf).amax(dim=-1)
    reach = ends + _between(draws[:, 3 : 3 + _EDGES], *_GAP)
    second = draws[:, 3 + _EDGES] < _SECOND
    reach[:, 1] = torch.where(second, reach[:, 1], torch.inf)
    return _Table(
        outward, reach, _between(draws[:, 2], *_DROP),
        draws[:, 3 + 2 * _EDGES :].unflatten(1, (_THINGS, -1)),
    )  # fmt: skip


def _middles(scenes: SceneParameters) -> Tensor:
    """Middles (B, 2) of what stands on tables."""
    count = scenes.present.sum(dim=1, keepdim=True).clamp_min(1)
    places = torch.where(scenes.present[..., None], scenes.positions, 0.0)[..., :2]
    return places.sum(dim=1) / count


def _things(
    table: _Table, middles: Tensor, cameras: CameraBatch, changed_mask: Tensor
) -> SceneParameters:
    """Superquadrics (B, `_THINGS`) that stand on the floor, beyond the first edge.

    None stands nearer to the camera than its table: it would hide what is on that.
    """
    draws = table.things
    half_axes = _between(draws[..., :3], *_SIZE)
    angle = 2 * np.pi * draws[..., 3]
    zero, unit = torch.zeros_like(angle), torch.ones_like(angle)
    rotations = torch.stack(
        [angle.cos(), -angle.sin(), zero, angle.sin(), angle.cos(), zero, zero, zero, unit], dim=-1
    ).unflatten(-1, (3, 3))
    outward = table.outward[:, :1]
    beside = torch.stack([-outward[..., 1], outward[..., 0]], dim=-1)
    radius = half_axes[..., :2].norm(dim=-1)
    along = table.reach[:, :1] + radius + _between(draws[..., 4], *_AWAY)
    aside = (middles[:, None] * beside).sum(dim=-1) + _ASIDE * (2 * draws[..., 5] - 1)
    places = along[..., None] * outward + aside[..., None] * beside
    levels = half_axes[..., 2:] - table.height[:, None, None]
    exponents = _between(draws[..., 6:7], 2.0, 12.0).expand_as(half_axes)
    eyes = cameras.T_world_camera[:, None, :2, 3]
    nearest = (places - eyes).norm(dim=-1) - radius
    behind = nearest > (middles[:, None] - eyes).norm(dim=-1)
    return SceneParameters(
        half_axes,
        exponents.contiguous(),
        rotations,
        torch.cat([places, levels], dim=-1),
        (draws[..., 7] < _PRESENT) & behind & changed_mask[:, None],
    )


def _between(chance: Tensor, low: float, high: float) -> Tensor:
    return low + (high - low) * chance
