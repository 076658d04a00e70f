"""Small images of where pixels lie, as networks of images see them."""

from __future__ import annotations

import torch
from torch import Tensor

CELL = 4
"""Pixels along a side of a cell, for each of which a network has one feature."""
CHANNELS = 11
"""Of `place_image`."""
_STEP = 0.02  # m, between pixels two apart: clearly the same surface below, another above
_HEIGHT, _WIDE = 0.1, 0.2  # m
_BOUND = 2.0  # of all channels


def place_image(places: Tensor, above: Tensor) -> Tensor:
    """What a network of images sees (B, 11, H, W).

    Steps to the right and down (along x, y and z) say how surfaces lie and where they end. Then
    come x, y and height of the place, 1 for what stands on the floor, and 1 for what is measured;
    the others are 0 elsewhere. All are bounded softly, as the floor may go on for metres.

    Args:
        places: (B, H, W, 3) m, NaN where nothing is measured.
        above: (B, H, W) bool: what is seen above the floor.
    """
    right, down = (_steps(places, axis) / _STEP for axis in (2, 1))
    scale = places.new_tensor([_WIDE, _WIDE, _HEIGHT])
    wide = torch.cat([right, down, places / scale], dim=-1)
    flags = torch.stack([above, ~places.isnan().any(dim=-1)], dim=-1)
    channels = torch.cat([wide / (1 + wide.abs() / _BOUND), flags], dim=-1)
    return channels.nan_to_num(0.0).permute(0, 3, 1, 2).contiguous()


def cell_points(places: Tensor, above: Tensor) -> tuple[Tensor, Tensor]:
    """A place (B, P, 3) for each cell, row by row, and whether it shows what stands (B, P).

    Of the pixels of a cell above the floor, the one nearest to its middle counts.

    Args:
        places: (B, H, W, 3) m; H and W are multiples of `CELL`.
        above: (B, H, W) bool.
    """
    spots = _cells(places)
    above_cells = _cells(above[..., None])[..., 0]
    middle = (CELL - 1) / 2
    along = torch.arange(CELL, device=places.device) - middle
    nearness = 2 * CELL**2 - (along[:, None] ** 2 + along**2).flatten()
    best = torch.where(above_cells, nearness, 0.0).argmax(dim=-1)
    points = spots.gather(2, best[..., None, None].expand(-1, -1, 1, 3))[:, :, 0]
    counted = above_cells.any(dim=-1)
    return torch.where(counted[..., None], points, 0.0), counted


def _steps(places: Tensor, axis: int) -> Tensor:
    """From the pixel before to the one after; at borders from the pixel itself."""
    size = places.shape[axis]
    at = torch.arange(size, device=places.device)
    after, before = (at + 1).clamp_max(size - 1), (at - 1).clamp_min(0)
    return places.index_select(axis, after) - places.index_select(axis, before)


def _cells(values: Tensor) -> Tensor:
    """(B, P, CELL * CELL, C) of (B, H, W, C)."""
    batch, height, width, channels = values.shape
    blocks = values.view(batch, height // CELL, CELL, width // CELL, CELL, channels)
    return blocks.transpose(2, 3).reshape(batch, -1, CELL * CELL, channels)
