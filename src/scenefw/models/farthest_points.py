"""Points of a set that are far from each other."""

import torch
from torch import Tensor


@torch.no_grad()
def farthest_points(points: Tensor, visible: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Positions (B, K) in sets of points, each the farthest from those before it, and which count.

    The first is the one farthest from the middle. So which points are taken doesn't depend on their
    order, and the first few of many are those that fewer would be.

    Args:
        points: (B, P, 3).
        visible: (B, P) bool, points that count.
        count: K.

    Returns:
        (B, K) int64, and (B, K) bool: False once no further point is left.
    """
    weights = visible.to(points.dtype)
    middle = (points * weights[..., None]).sum(dim=1) / weights.sum(dim=1, keepdim=True).clamp_min(
        1
    )
    gaps = (points - middle[:, None]).square().sum(dim=-1) + 1.0  # the first counts in any case
    gaps = torch.where(visible, gaps, -1.0)
    nearest = torch.where(visible, torch.inf, -1.0).to(points.dtype)
    indices, counted = [], []
    for _ in range(count):
        best, place = gaps.max(dim=1)
        indices.append(place)
        counted.append(best > 0)
        point = points.gather(1, place[:, None, None].expand(-1, 1, 3))
        nearest = nearest.minimum((points - point).square().sum(dim=-1))
        gaps = torch.where(visible, nearest, -1.0)
    return torch.stack(indices, dim=1), torch.stack(counted, dim=1)
