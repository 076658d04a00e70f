"""Objects that would hang in the air or sink into the floor, made to stand on something."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.types import Pose
from scenefw.fitting.placed import in_frame_of, shape_of
from scenefw.perception.observation.free_space import free_ratio

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Float64, GridSpec

_GAP = 0.01  # m: what is no higher above something stands on it
_UPRIGHT = 0.95  # cosine between an axis and the vertical from which on it is the one that grows
_WITHIN, _ACROSS = 0.8, 5  # share of the footprint that is looked below, places along each side
_STEP = 0.005  # m, downwards
_LEAST = 0.004  # m, of half-axes
_THROUGH = 0.1  # share of what is added that may lie where the view sees through


def extend_to_support(
    objects: Sequence[FittedSuperquadric], free: NDArray[np.bool_], grid: GridSpec
) -> list[FittedSuperquadric]:
    """Objects, of which those that hang in the air go on to what is below; none is in the floor.

    A view from above shows the top of a box and no side, and how high it is nobody sees. Whatever
    is below it, another object or the floor (z = 0), carries it. Objects of which no axis is nearly
    vertical stay as they are, and so do those below which the view sees through: something else
    may hold these.

    Args:
        objects: superquadrics, in the world.
        free: (X, Y, Z) what the view shows to be free.
        grid: of free space.
    """
    return [
        _let_down(one, [other for other in objects if other is not one], free, grid)
        for one in objects
    ]


def _let_down(
    one: FittedSuperquadric,
    others: Sequence[FittedSuperquadric],
    free: NDArray[np.bool_],
    grid: GridSpec,
) -> FittedSuperquadric:
    vertical = one.pose.rotation[2]
    axis = int(np.abs(vertical).argmax())
    lowest = float((shape_of(one).mesh(_ACROSS).vertices @ vertical).min() + one.pose.position[2])
    if abs(vertical[axis]) < _UPRIGHT:
        return one
    if lowest <= _GAP:
        return _longer(one, axis, min(lowest, 0.0))
    heights = np.arange(lowest - _STEP, 0, -_STEP)
    below = _footprint(one, axis)[None] * [1.0, 1.0, 0.0] + heights[:, None, None] * [0.0, 0.0, 1.0]
    carried = np.zeros(len(heights), dtype=bool)
    for other in others:
        inside = shape_of(other).value(in_frame_of(other, below)) < 1
        carried |= inside.any(axis=1)
    there = int(carried.argmax()) if carried.any() else len(heights)
    gap = lowest - (heights[there] if carried.any() else 0.0)
    if gap <= _GAP or free_ratio(below[:there], free, grid) > _THROUGH:
        return one
    return _longer(one, axis, gap)


def _longer(one: FittedSuperquadric, axis: int, by: float) -> FittedSuperquadric:
    """An object whose lower end lies so much further down (m), if something of it is left."""
    half_axes = one.half_axes.copy()
    half_axes[axis] += by / 2
    if by == 0 or half_axes[axis] < _LEAST:
        return one
    down = -np.sign(one.pose.rotation[2, axis]) * one.pose.rotation[:, axis]
    pose = Pose(one.pose.position + down * by / 2, one.pose.quaternion)
    return replace(one, half_axes=half_axes, pose=pose)


def _footprint(one: FittedSuperquadric, axis: int) -> Float64:
    """Places (P, 3) of the world at the height of its centre, over most of its width."""
    places = np.linspace(-_WITHIN, _WITHIN, _ACROSS)
    local = np.zeros((_ACROSS**2, 3))
    first, second = (k for k in range(3) if k != axis)
    local[:, first], local[:, second] = (
        one_side.ravel() for one_side in np.meshgrid(places, places)
    )
    return np.asarray((local * one.half_axes) @ one.pose.rotation.T + one.pose.position)
