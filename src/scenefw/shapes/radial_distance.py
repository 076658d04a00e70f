"""Signed distance to superquadrics along rays from their centres, with gradients."""

from __future__ import annotations

import torch
from torch import Tensor

_TINY = 1e-4  # m: a point's coordinates count as this far from zero at least


def radial_distance(points: Tensor, half_axes: Tensor, exponents: Tensor, steps: int = 5) -> Tensor:
    """Signed distance (...) of points to |x/a1|^r + |y/a2|^s + |z/a3|^t = 1 along their rays.

    The shift l with log sum_i exp(e_i (log|x_i / a_i| - l)) = 0 takes a point to the surface,
    x e^-l; the value is |x| (1 - e^-l). It has the sign and the zeros of the true distance and is
    never nearer to zero. Newton's method finds l without a gradient; one more step has the gradient
    that the implicit function has.

    Args:
        points: (..., 3) in the object's frame (m).
        half_axes: (..., 3) m.
        exponents: (..., 3), 1 or more.
        steps: of Newton's method.
    """
    magnitudes = (points.square() + _TINY**2).sqrt()
    ratios = magnitudes.log() - half_axes.log()
    with torch.no_grad():
        # From the left of the root steps never pass it, so no term is ever above zero.
        shift = ratios.amax(dim=-1, keepdim=True)
        for _ in range(steps):
            parts = (exponents * (ratios - shift)).exp()
            total = parts.sum(dim=-1, keepdim=True)
            slope = (parts * exponents).sum(dim=-1, keepdim=True) / total
            shift = shift + total.log() / slope
    level = (exponents * (ratios - shift)).exp().sum(dim=-1).log()
    root = shift[..., 0] + level / slope[..., 0]
    return torch.linalg.vector_norm(magnitudes, dim=-1) * (1 - (-root).exp())


def in_frame(points: Tensor, rotations: Tensor, positions: Tensor) -> Tensor:
    """Points (..., Q, 3) of the world in the frames of objects.

    Args:
        points: (..., Q, 3) m.
        rotations: (..., 3, 3), object to world.
        positions: (..., 3) m.
    """
    return (points - positions[..., None, :]) @ rotations
