"""Superquadrics made into cups and into things of two pieces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from scenefw.core.batches import SceneParameters
from scenefw.kernels.transfer import to_device

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.rng import Streams

_DRAWS = 16  # numbers of an object
_WALL, _BOTTOM = (0.04, 0.2), (0.1, 0.45)  # in half-axes: of a cup
_PIECE, _AWAY, _ASIDE = (0.25, 0.9), (0.5, 1.0), 0.5  # size and place of a second piece, likewise
_THINNEST = 0.006  # m, half
_EXPONENTS = (2.0, 40.0)


def compounds(
    scenes: SceneParameters,
    streams: Streams,
    changed: NDArray[np.bool_],
    hollow: float,
    pieces: float,
) -> tuple[SceneParameters, SceneParameters]:
    """Scenes of twice as many slots, and what is cut out of them.

    Slots N to 2 N - 1 are second pieces: each goes through the surface of the object N slots before
    it. A hole opens upward, one in five along any axis. Objects below don't carry what
    stands on a hole: only rays look at these scenes.

    Args:
        scenes: B of up to N objects.
        streams: one per scene.
        changed: (B,) which scenes; the others stay as they are.
        hollow: share of objects with a hole.
        pieces: share of objects with a second piece.
    """
    batch, slots = scenes.present.shape
    numbers = streams.uniform(_DRAWS * slots).reshape(batch, slots, _DRAWS).astype(np.float32)
    draws, changed_mask = to_device([numbers, changed[:, None]], scenes.positions.device)
    second = _second_pieces(scenes, draws[..., 2:12], changed_mask & (draws[..., 0] < pieces))
    holes = _holes(scenes, draws[..., 12:16], changed_mask & (draws[..., 1] < hollow))
    none = SceneParameters(
        second.half_axes, second.exponents, second.rotations, second.positions,
        torch.zeros_like(second.present),
    )  # fmt: skip
    return _together(scenes, second), _together(holes, none)


def _holes(scenes: SceneParameters, draws: Tensor, mask: Tensor) -> SceneParameters:
    """What is cut out of the objects to hollow, as superquadrics that lie in them.

    A hole has the object's shape, narrower by a wall on all sides but along one axis. Along that
    axis it keeps its length and is moved outward, so that it leaves a bottom at one end and opens
    the other. The axis is mostly the one that points up, for things that stand open side up.

    Args:
        scenes: the objects.
        draws: (B, N, 4) in [0, 1): wall, bottom, which axis, and whether that is any of the three.
        mask: (B, N) objects that get a hole.
    """
    upward = scenes.rotations[:, :, 2]
    anywhere = draws[..., 3] < 0.2
    axis = torch.where(anywhere, (3 * draws[..., 2]).long().clamp_max(2), upward.abs().argmax(-1))
    sign = torch.where(upward.gather(2, axis[..., None])[..., 0] < 0, -1.0, 1.0)
    axis_mask = torch.nn.functional.one_hot(axis, 3).float()
    wall = _between(draws[..., 0], *_WALL)[..., None]
    shift = sign[..., None] * _between(draws[..., 1], *_BOTTOM)[..., None] * axis_mask
    places = scenes.positions + _turned(scenes, shift * scenes.half_axes)
    axes = (scenes.half_axes * torch.where(axis_mask > 0, 1.0, 1 - wall)).clamp_min(1e-3)
    return SceneParameters(axes, scenes.exponents, scenes.rotations, places, scenes.present & mask)


def _second_pieces(scenes: SceneParameters, draws: Tensor, mask: Tensor) -> SceneParameters:
    """A piece of each object that goes through its surface: a handle, a neck, a foot."""
    axis = (3 * draws[..., 0]).long().clamp_max(2)
    axis_mask = torch.nn.functional.one_hot(axis, 3).float()
    sign = torch.where(draws[..., 1] < 0.5, -1.0, 1.0)[..., None]
    along = sign * _between(draws[..., 2], *_AWAY)[..., None]
    aside = _ASIDE * (2 * draws[..., 3:6] - 1)
    local = scenes.half_axes * torch.where(axis_mask > 0, along, aside)
    low, high = (float(np.log(exponent)) for exponent in _EXPONENTS)
    exponents = _between(draws[..., 9], low, high).exp()[..., None].expand_as(local)
    return SceneParameters(
        (scenes.half_axes * _between(draws[..., 6:9], *_PIECE)).clamp_min(_THINNEST),
        exponents,
        scenes.rotations,
        scenes.positions + _turned(scenes, local),
        scenes.present & mask,
    )


def _between(chance: Tensor, low: float, high: float) -> Tensor:
    return low + (high - low) * chance


def _turned(scenes: SceneParameters, local: Tensor) -> Tensor:
    return torch.einsum("bnij,bnj->bni", scenes.rotations, local)


def _together(first: SceneParameters, second: SceneParameters) -> SceneParameters:
    names = ("half_axes", "exponents", "rotations", "positions", "present")
    return SceneParameters(
        *(torch.cat([getattr(first, name), getattr(second, name)], dim=1) for name in names)
    )
