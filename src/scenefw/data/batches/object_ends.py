"""Where the image of each object ends: against what is behind it, or behind what hides it."""

from __future__ import annotations

import torch
from torch import Tensor

SIZE = 7
"""Numbers of an end: where it is 3 (m), direction outward 3, how much further what follows is 1."""
_FAR = 0.5  # m: what is further behind, or before, is as good as that
_BESIDE = ((0, 1), (0, -1), (1, 0), (-1, 0))  # rows, columns


@torch.no_grad()
def object_ends(points: Tensor, owners: Tensor, eye: Tensor, chances: Tensor) -> Tensor:
    """Some of the pixels of each object beside which there is something else.

    An object ends where what follows is further away. Where it is nearer, the object is hidden and
    may go on.

    Args:
        points: (B, H, W, 3) world coordinates of pixels (m), NaN = unknown.
        owners: (B, H, W) whose they are: 0 = of none of the objects, i + 1 = object i.
        eye: (B, 3) where the cameras are (m).
        chances: (B, N, E) in [0, 1): which pixels are taken of each of N objects.

    Returns:
        (B, N, E, 7): the point (m), the direction outward at right angles to the ray, and by how
        much what follows is further from the camera (m); all 0 for objects without such pixels.
    """
    batch, slots, _ = chances.shape
    reach = points - eye[:, None, None]
    distance = reach.norm(dim=-1)
    valid = torch.isfinite(distance)
    beside = torch.stack([_shifted(owners, *step, -1) for step in _BESIDE], dim=1)
    valid_beside = torch.stack([_shifted(valid, *step, False) for step in _BESIDE], dim=1)
    owner = owners[:, None]
    ends = (owner > 0) & (owner <= slots) & valid[:, None] & valid_beside & (beside != owner)
    view, way, row, column = ends.nonzero().unbind(1)
    key = view * slots + owners[view, row, column].long() - 1
    order = key.argsort(stable=True)
    counts = torch.bincount(key, minlength=batch * slots).view(batch, slots, 1)
    if not len(key):
        return points.new_zeros(*chances.shape, SIZE)
    starts = counts.flatten().cumsum(0).view_as(counts) - counts
    picks = starts + (chances * counts).long().minimum((counts - 1).clamp_min(0))
    picks = order[picks.clamp_max(len(order) - 1)]
    view, row, column = view[picks], row[picks], column[picks]
    steps = torch.tensor(_BESIDE, device=points.device)[way[picks]]
    first = reach[view, row, column]
    second = reach[view, row + steps[..., 0], column + steps[..., 1]]
    first_range, second_range = first.norm(dim=-1, keepdim=True), second.norm(dim=-1, keepdim=True)
    ray = first / first_range
    across = second / second_range - (second / second_range * ray).sum(dim=-1, keepdim=True) * ray
    outward = torch.nn.functional.normalize(across, dim=-1)
    gap = (second_range - first_range).clamp(-_FAR, _FAR)
    samples = torch.cat([points[view, row, column], outward, gap], dim=-1)
    return torch.where(counts[..., None] > 0, samples, 0.0)


def _shifted(image: Tensor, rows: int, columns: int, outside: float) -> Tensor:
    """What is beside each pixel of (B, H, W)."""
    neighbours = image.roll((-rows, -columns), dims=(1, 2)).clone()
    if rows:
        neighbours[:, -1 if rows > 0 else 0] = outside
    if columns:
        neighbours[:, :, -1 if columns > 0 else 0] = outside
    return neighbours
