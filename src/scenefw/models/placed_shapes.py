"""Shapes that are put into a grid by boxes, and the places of cells in it."""

import torch
from torch import Tensor

_NOTHING = -10.0  # logit outside all boxes
_MARGIN = 1.25  # sides of what is decoded, in sides of the box: its surface lies within


def places_of(cells: Tensor, side: int) -> Tensor:
    """Middles (..., 3) of cells (...) of a volume in the cube of the grid, from -1 to 1."""
    indices = torch.stack(torch.unravel_index(cells, (side,) * 3), dim=-1)
    return (indices + 0.5) * (2 / side) - 1


def placed(shapes: Tensor, boxes: Tensor, resolution: int) -> Tensor:
    """Logits of shapes, put into a grid by linear interpolation; differentiable in both.

    Boxes lie along the axes, so interpolation is a product of one small matrix for each axis.

    Args:
        shapes: (B, N, S, S, S) logits that fill 5/4 of their box along each axis.
        boxes: (B, N, 2, 3) centres and half sides in the cube of the grid, from -1 to 1.
        resolution: voxels per side of the grid.

    Returns:
        (B, N, X, Y, Z), -10 away from the box.
    """
    side = shapes.shape[-1]
    of_shapes = {"device": shapes.device, "dtype": shapes.dtype}
    voxels = (torch.arange(resolution, **of_shapes) + 0.5) * (2 / resolution) - 1
    centres, halves = boxes.to(shapes.dtype).unbind(dim=-2)
    inside = (voxels - centres[..., None]) / (_MARGIN * halves[..., None])  # (B, N, 3, X)
    where = (inside + 1) * (side / 2) - 0.5
    steps = torch.arange(side, **of_shapes)
    weights = (1 - (where[..., None] - steps).abs()).clamp_min(0)  # (B, N, 3, X, S)
    x, y, z = weights.flatten(0, 1).unbind(dim=1)
    volume = (shapes - _NOTHING).flatten(0, 1)
    count = volume.shape[0]
    volume = x @ volume.reshape(count, side, side * side)
    volume = y[:, None] @ volume.reshape(count, resolution, side, side)
    volume = volume @ z.transpose(1, 2)[:, None]
    return volume.unflatten(0, shapes.shape[:2]) + _NOTHING
