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
    known = torch.isfinite(distance)
    beside = torch.stack([_shifted(owners, *step, -1) for step in _BESIDE], dim=1)
    seen = torch.stack([_shifted(known, *step, False) for step in _BESIDE], dim=1)
    here = owners[:, None]
    ends = (here > 0) & (here <= slots) & known[:, None] & seen & (beside != here)
    view, way, row, column = ends.nonzero().unbind(1)
    key = view * slots + owners[view, row, column].long() - 1
    order = key.argsort(stable=True)
    counts = torch.bincount(key, minlength=batch * slots).view(batch, slots, 1)
    if not len(key):
        return points.new_zeros(*chances.shape, SIZE)
    starts = counts.flatten().cumsum(0).view_as(counts) - counts
    taken = starts + (chances * counts).long().minimum((counts - 1).clamp_min(0))
    taken = order[taken.clamp_max(len(order) - 1)]
    view, row, column = view[taken], row[taken], column[taken]
    steps = torch.tensor(_BESIDE, device=points.device)[way[taken]]
    first = reach[view, row, column]
    second = reach[view, row + steps[..., 0], column + steps[..., 1]]
    near, far = first.norm(dim=-1, keepdim=True), second.norm(dim=-1, keepdim=True)
    ray = first / near
    across = second / far - (second / far * ray).sum(dim=-1, keepdim=True) * ray
    outward = torch.nn.functional.normalize(across, dim=-1)
    further = (far - near).clamp(-_FAR, _FAR)
    found = torch.cat([points[view, row, column], outward, further], dim=-1)
    return torch.where(counts[..., None] > 0, found, 0.0)


def _shifted(image: Tensor, rows: int, columns: int, outside: float) -> Tensor:
    """What is beside each pixel of (B, H, W)."""
    moved = image.roll((-rows, -columns), dims=(1, 2)).clone()
    if rows:
        moved[:, -1 if rows > 0 else 0] = outside
    if columns:
        moved[:, :, -1 if columns > 0 else 0] = outside
    return moved
