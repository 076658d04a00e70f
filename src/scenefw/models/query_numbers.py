"""Superquadrics as the numbers that queries change, and true ones with noise."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import torch
from torch import Tensor, nn

from scenefw.kernels.precision import full_precision
from scenefw.shapes.equal_descriptions import equal_descriptions

if TYPE_CHECKING:
    from scenefw.core.batches import SceneParameters

SIZE = 15
"""Numbers of an object: centre 3, two columns of its rotation 6, half-axes 3, exponents 3."""
_REACH = 0.1  # m, of centres from where queries start, for a number of one
_TYPICAL, _WIDEST = 0.06, 2.0  # m, of half-axes; most by which their logarithms differ from it
_LEAST_EXPONENT, _EXPONENTS = math.log(2), 3.9
_MOST = 0.98  # of what is bounded, so that its numbers stay finite
_NOISE = (0.2, 0.4, 1.0)  # standard deviations: columns of rotations, sizes, exponents
_NEAR, _FAR = 0.015, (0.05, 0.12)  # m: deviation of near starts along an axis; how far others are
_OCCUPIED = 0.04  # m from the middle of another object: that one is meant there


class Noised(NamedTuple):
    """Where denoising queries start, G groups for each of B views, in rows one after the other.

    Args:
        starts: (B G, N, 3) m.
        numbers: (B G, N, 15).
        active: (B G, N) bool.
        objects: (B G, N) int64, the object near which each starts; -1: none is near.
    """

    starts: Tensor
    numbers: Tensor
    active: Tensor
    objects: Tensor


def parameters_of(numbers: Tensor, starts: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Positions, rotations, half-axes and exponents: any numbers make a solid.

    Args:
        numbers: (..., 15).
        starts: (..., 3) m, what centres are told from.
    """
    first = nn.functional.normalize(numbers[..., 3:6] + numbers.new_tensor([1.0, 0, 0]), dim=-1)
    second = numbers[..., 6:9] + numbers.new_tensor([0, 1.0, 0])
    second = second - (first * second).sum(dim=-1, keepdim=True) * first
    second = nn.functional.normalize(second, dim=-1)
    wide = _WIDEST * (numbers[..., 9:12] / _WIDEST).tanh()
    return (
        starts + _REACH * numbers[..., :3],
        torch.stack([first, second, torch.linalg.cross(first, second)], dim=-1),
        _TYPICAL * wide.exp(),
        (_LEAST_EXPONENT + _EXPONENTS * numbers[..., 12:15].sigmoid()).exp(),
    )


@full_precision()
def numbers_of(scenes: SceneParameters) -> Tensor:
    """Numbers (B, M, 15) of objects, told from their centres.

    Of the 24 equal descriptions, the one that is turned least is taken. Sizes and exponents keep to
    98 % of the bounds of `parameters_of`, as numbers would be infinite there: exponents are 2.2 or
    more.
    """
    ways = equal_descriptions().to(scenes.rotations)
    turned = scenes.rotations[..., None, :, :] @ ways
    best = turned.diagonal(dim1=-2, dim2=-1).sum(dim=-1).argmax(dim=-1)
    rotations = turned.gather(2, best[..., None, None, None].expand(-1, -1, 1, 3, 3))[:, :, 0]
    order = ways.abs().transpose(-1, -2)[best]
    axes, exponents = (
        (order @ values[..., None])[..., 0] for values in (scenes.half_axes, scenes.exponents)
    )
    columns = rotations.transpose(-1, -2)[..., :2, :].flatten(-2)
    wide = ((axes.clamp_min(1e-4) / _TYPICAL).log() / _WIDEST).clamp(-_MOST, _MOST)
    sharp = (exponents.clamp_min(1.0).log() - _LEAST_EXPONENT) / _EXPONENTS
    return torch.cat(
        [
            torch.zeros_like(axes),
            columns - columns.new_tensor([1.0, 0, 0, 0, 1.0, 0]),
            _WIDEST * wide.atanh(),
            sharp.clamp(1 - _MOST, _MOST).logit(),
        ],
        dim=-1,
    )


@torch.no_grad()
def noised(scenes: SceneParameters, groups: int, generator: torch.Generator) -> Noised:
    """Objects with noise: in each group one start near each object, and one too far away.

    What is too far from its own object doesn't count if another object is there.

    Args:
        scenes: of up to M objects; N is 2 M, first those that are near.
        groups: for each view, G.
        generator: of the noise, on the CPU.
    """
    device = scenes.positions.device
    batch, max_objects = scenes.present.shape
    shape = (batch, groups, 2, max_objects)

    def normal(size: int) -> Tensor:
        return torch.randn(*shape, size, generator=generator).to(device)

    turn, size, sharp = _NOISE
    wrong = [torch.zeros(*shape, 3, device=device), turn * normal(6), size * normal(3),
             sharp * normal(3)]  # fmt: skip
    numbers = numbers_of(scenes)[:, None, None] + torch.cat(wrong, dim=-1)
    offsets, chances = normal(3), torch.rand(*shape, 1, generator=generator).to(device)
    low, high = _FAR
    far = (low + (high - low) * chances) * nn.functional.normalize(offsets, dim=-1)
    is_near = torch.tensor([True, False], device=device)[:, None]
    starts = scenes.positions[:, None, None] + torch.where(is_near[..., None], _NEAR * offsets, far)
    active = scenes.present[:, None, None].expand(shape)
    gaps = torch.cdist(starts.flatten(1, 3), scenes.positions)
    is_occupied = ((gaps < _OCCUPIED) & scenes.present[:, None]).any(dim=-1).view(shape)
    objects = torch.arange(max_objects, device=device).expand(shape)
    return Noised(
        starts.flatten(2, 3).flatten(0, 1),
        numbers.flatten(2, 3).flatten(0, 1),
        (active & (is_near | ~is_occupied)).flatten(2).flatten(0, 1),
        torch.where(is_near & active, objects, -1).flatten(2).flatten(0, 1),
    )
