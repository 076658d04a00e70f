"""Places about superquadrics, with the distances that networks learn there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from scenefw.core.errors import SettingError
from scenefw.shapes.radial_distance import radial_distance

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import SceneParameters

CHANCES = 7
"""Random numbers of each place: axis, side, three coordinates, two for its distance."""
_ROOM = (1.5, 0.02)  # the box about an object in which places lie: times its half-axes, plus (m)


def require_places(places: int) -> None:
    """Whether half of the places can lie near a surface.

    Raises:
        SettingError: the number is odd, or below 2.
    """
    if places < 2 or places % 2:
        raise SettingError("places", places, "an even number of 2 or more")


def placed_about(scenes: SceneParameters, chances: Tensor, sigma: float) -> tuple[Tensor, Tensor]:
    """Places (B, M, Q, 3) about objects (m, world), and distances (B, M, Q) to them (m).

    The first half lie near points of the surface that lie behind random ones of the six faces of a
    box about the object, the others anywhere in a somewhat larger box.

    Args:
        scenes: of up to M objects.
        chances: (B, M, Q, 7) uniform in [0, 1).
        sigma: standard deviation of the distance of the first half from the surface (m).
    """
    half_axes, exponents = scenes.half_axes[:, :, None], scenes.exponents[:, :, None]
    local = 2 * chances[..., 2:5] - 1
    axis = (3 * chances[..., :1]).long().clamp_max(2)
    on_box = local.scatter(-1, axis, torch.where(chances[..., 1:2] < 0.5, -1.0, 1.0)) * half_axes
    radius = torch.linalg.vector_norm(on_box, dim=-1).clamp_min(1e-6)
    excess = radial_distance(on_box, half_axes, exponents)
    normal = (-2 * (1 - chances[..., 5]).clamp_min(1e-7).log()).sqrt()
    shift = sigma * normal * (2 * torch.pi * chances[..., 6]).cos()
    close = on_box * (1 + (shift - excess) / radius)[..., None]
    factor, room = _ROOM
    half = chances.shape[2] // 2
    wide = local * (factor * half_axes + room)
    local = torch.cat([close[:, :, :half], wide[:, :, half:]], dim=2)
    places = torch.einsum("bmij,bmqj->bmqi", scenes.rotations, local) + scenes.positions[:, :, None]
    present = scenes.present[:, :, None]
    distances = torch.where(present, radial_distance(local, half_axes, exponents), 0.0)
    return torch.where(present[..., None], places, 0.0), distances
