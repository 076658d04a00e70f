"""Scenes of superquadrics elsewhere: larger, in a mirror, in another frame."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import torch

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import SceneParameters


def scaled(scenes: SceneParameters, factors: Tensor) -> SceneParameters:
    """Scenes (B) times factors (B, 1), about the origin on the floor."""
    by = factors[:, :, None]
    return replace(scenes, half_axes=scenes.half_axes * by, positions=scenes.positions * by)


def mirrored(scenes: SceneParameters, mask: Tensor) -> SceneParameters:
    """Those scenes that `mask` (B,) names, in a mirror: y becomes -y.

    Superquadrics are their own mirror images, so rotations stay proper ones.
    """
    sign = torch.where(mask, -1.0, 1.0)
    flip = torch.stack([torch.ones_like(sign), sign, torch.ones_like(sign)], dim=-1)
    return replace(
        scenes,
        rotations=scenes.rotations * flip[:, None, :, None] * sign[:, None, None, None],
        positions=scenes.positions * flip[:, None],
    )


def in_frames(scenes: SceneParameters, turns: Tensor, origins: Tensor) -> SceneParameters:
    """Scenes in other frames.

    Args:
        scenes: in the world.
        turns: (B, 3, 3) from the world to the frames.
        origins: (B, 3) m, of the frames in the world.
    """
    return replace(
        scenes,
        rotations=torch.einsum("bij,bnjk->bnik", turns, scenes.rotations),
        positions=torch.einsum("bij,bnj->bni", turns, scenes.positions - origins[:, None]),
    )
