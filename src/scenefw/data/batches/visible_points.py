"""Points of what depth images show above the floor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from scenefw.kernels.cameras import pixel_places

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import CameraBatch
    from scenefw.core.types import GridSpec

LOWEST = 0.006
"""m above the floor: what is lower may be the floor itself."""


def seen_points(
    depth: Tensor, cameras: CameraBatch, grid: GridSpec, chances: Tensor
) -> tuple[Tensor, Tensor]:
    """Points (B, P, 3) of the world (m), and whether they count (B, P): none do in an empty view.

    They are spread evenly over the pixels that show something inside the grid and above the floor,
    row by row. Where there are fewer pixels than points, some are there several times.

    Args:
        depth: (B, H, W) z-depth (m), 0 = no measurement.
        cameras: of these images.
        grid: outside which nothing counts.
        chances: (B, P) uniform in [0, 1).
    """
    places = pixel_places(depth, cameras).flatten(1, 2)
    lower = places.new_tensor(grid.lower)
    inside = ((places > lower) & (places < lower + grid.extent)).all(dim=-1)
    valid = (depth.flatten(1) > 0) & inside & (places[..., 2] > LOWEST)
    counts = valid.sum(dim=1, keepdim=True)
    order = (~valid).to(torch.uint8).argsort(dim=1, stable=True)
    points = chances.shape[1]
    shares = (torch.arange(points, device=chances.device) + chances) / points
    ranks = (shares * counts).long().minimum((counts - 1).clamp_min(0))
    pixels = order.gather(1, ranks)
    samples = places.gather(1, pixels[..., None].expand(-1, -1, 3))
    return samples, (counts > 0).expand(-1, points)
