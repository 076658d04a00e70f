"""Superquadrics as standardised numbers that networks predict, and their equal descriptions."""

from __future__ import annotations

import torch
from torch import Tensor

from scenefw.kernels.precision import full_precision
from scenefw.shapes.equal_descriptions import equal_descriptions

SIZE = 15
"""Numbers of an object: centre 3, two columns of the rotation 6, half-axes 3, exponents 3."""
_SPREAD = 0.05  # m, of centres about what is seen of an object
_TYPICAL, _DEVIATION = -3.0, 0.7  # of logarithms of half-axes (m)
_EXPONENT, _EXPONENT_DEVIATION = 2.7, 1.1  # of logarithms of exponents
_RANGE = 1.1, 100.0


def encode(
    centres: Tensor, rotations: Tensor, half_axes: Tensor, exponents: Tensor, anchors: Tensor
) -> Tensor:
    """Numbers (..., 15) about zero with a deviation of about one.

    Args:
        centres: (..., 3) m.
        rotations: (..., 3, 3).
        half_axes: (..., 3) m.
        exponents: (..., 3).
        anchors: (..., 3), what centres are told from (m).
    """
    columns = rotations.transpose(-1, -2)[..., :2, :].flatten(-2)
    return torch.cat(
        [
            (centres - anchors) / _SPREAD,
            columns,
            (half_axes.log() - _TYPICAL) / _DEVIATION,
            (exponents.log() - _EXPONENT) / _EXPONENT_DEVIATION,
        ],
        dim=-1,
    )


def decode(numbers: Tensor, anchors: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Centres, rotations, half-axes and exponents of numbers (..., 15), as `encode` takes them."""
    centres = numbers[..., :3] * _SPREAD + anchors
    first = torch.nn.functional.normalize(numbers[..., 3:6], dim=-1)
    second = numbers[..., 6:9]
    second = second - (first * second).sum(dim=-1, keepdim=True) * first
    second = torch.nn.functional.normalize(second, dim=-1)
    rotations = torch.stack([first, second, torch.linalg.cross(first, second)], dim=-1)
    half_axes = (numbers[..., 9:12] * _DEVIATION + _TYPICAL).exp()
    exponents = (numbers[..., 12:15] * _EXPONENT_DEVIATION + _EXPONENT).exp().clamp(*_RANGE)
    return centres, rotations, half_axes, exponents


@full_precision()
def described_in_all_ways(numbers: Tensor) -> Tensor:
    """The same objects (..., 15) in all 24 ways, (..., 24, 15)."""
    ways = equal_descriptions().to(numbers)
    first, second = numbers[..., 3:6], numbers[..., 6:9]
    third = torch.linalg.cross(first, second)
    rotations = torch.stack([first, second, third], dim=-1)[..., None, :, :] @ ways
    columns = rotations.transpose(-1, -2)[..., :2, :].flatten(-2)
    order = ways.abs().transpose(-1, -2)
    axes = (order @ numbers[..., None, 9:12, None]).squeeze(-1)
    exponents = (order @ numbers[..., None, 12:15, None]).squeeze(-1)
    centres = numbers[..., None, :3].expand_as(axes)
    return torch.cat([centres, columns, axes, exponents], dim=-1)
