"""Objects that would hang in the air or sink into the floor, made to stand on something."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.lazy_mapping import LazyMapping
from scenefw.core.types import Pose
from scenefw.fitting.placed import EDGE_POINTS, MIN_HALF_AXIS, in_frame_of, shape_of
from scenefw.perception.observation.components import DETAIL, TOUCH
from scenefw.perception.observation.free_space import free_ratio
from scenefw.perception.observation.points import (
    MIN_PARALLEL_COSINE,
    MINORITY,
    STRAYS,
    points_by_label,
)
from scenefw.shapes.object_shell import Foot

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Float64, GridSpec
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.steps import ObjectSet
    from scenefw.shapes.object_shell import ObjectShell


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
        _extend_down(
            item, [neighbour for neighbour in objects if neighbour is not item], free, grid
        )
        for item in objects
    ]


def extend_shells(hypothesis: ObjectSet, view: Observation) -> ObjectSet:
    """The hypothesis, whose shells that hang in the air go on to what is below.

    What is visible of them stays as it is. Other objects are where their superquadrics are.
    """
    shapes = hypothesis.superquadrics or {}
    visible_points = points_by_label(hypothesis.objects.pixels, view.points)

    def extended(label: int) -> ObjectShell:
        shell = hypothesis.shells[label]
        places = shell.places()
        bottom = float(np.quantile(places[:, 2], STRAYS))
        neighbours = [shape for other, shape in shapes.items() if other != label]
        footprint = places[:: len(places) // EDGE_POINTS**2 + 1]
        gap = _gap(footprint, bottom, neighbours, view.clear, view.grid)
        heights = visible_points.get(label, np.empty((0, 3)))[:, 2]
        lowest_visible = float(np.nanmin(heights, initial=np.inf))
        top = max(min(lowest_visible, float(places[:, 2].max())), bottom + shell.pixel)
        foot = Foot(bottom - gap, bottom, top)
        return replace(shell, foot=foot) if gap else shell

    return replace(hypothesis, shells=LazyMapping(hypothesis.shells, extended))


def _extend_down(
    superquadric: FittedSuperquadric,
    neighbours: Sequence[FittedSuperquadric],
    free: NDArray[np.bool_],
    grid: GridSpec,
) -> FittedSuperquadric:
    vertical = superquadric.pose.rotation[2]
    axis = int(np.abs(vertical).argmax())
    lowest = shape_of(superquadric).support(-vertical)
    bottom = float(lowest @ vertical + superquadric.pose.position[2])
    if abs(vertical[axis]) < MIN_PARALLEL_COSINE:
        return superquadric
    if bottom <= TOUCH:
        return _lengthen(superquadric, axis, min(bottom, 0.0))
    footprint = _footprint(superquadric, axis)
    return _lengthen(superquadric, axis, _gap(footprint, bottom, neighbours, free, grid))


def _gap(
    footprint: Float64,
    bottom: float,
    neighbours: Sequence[FittedSuperquadric],
    free: NDArray[np.bool_],
    grid: GridSpec,
) -> float:
    """From a bottom down to what is below it (m); 0 if it touches that, or the view sees through.

    Args:
        footprint: (P, 2 or 3) places below which is looked.
        bottom: height of the lowest point (m).
        neighbours: that may carry it, as the floor may.
        free: (X, Y, Z) what the view shows to be free.
        grid: of free space.
    """
    heights = np.arange(bottom - DETAIL, 0, -DETAIL)
    probes = np.zeros((len(heights), len(footprint), 3))
    probes[..., :2], probes[..., 2] = footprint[:, :2], heights[:, None]
    support_mask = np.zeros(len(heights), dtype=bool)
    low, high = footprint[:, :2].min(axis=0), footprint[:, :2].max(axis=0)
    for neighbour in neighbours:
        radius, middle = np.linalg.norm(neighbour.half_axes), neighbour.pose.position[:2]
        if (middle + radius < low).any() or (middle - radius > high).any():
            continue
        inside = shape_of(neighbour).value(in_frame_of(neighbour, probes)) < 1
        support_mask |= inside.any(axis=1)
    support_index = int(support_mask.argmax()) if support_mask.any() else len(heights)
    gap = bottom - (heights[support_index] if support_mask.any() else 0.0)
    is_seen_through = free_ratio(probes[:support_index], free, grid) > MINORITY
    return 0.0 if gap <= TOUCH or is_seen_through else gap


def _lengthen(superquadric: FittedSuperquadric, axis: int, length: float) -> FittedSuperquadric:
    """An object whose lower end lies so much further down (m), if something of it is left."""
    half_axes = superquadric.half_axes.copy()
    half_axes[axis] += length / 2
    if length == 0 or half_axes[axis] < MIN_HALF_AXIS:
        return superquadric
    direction = -np.sign(superquadric.pose.rotation[2, axis]) * superquadric.pose.rotation[:, axis]
    pose = Pose(superquadric.pose.position + direction * length / 2, superquadric.pose.quaternion)
    return replace(superquadric, half_axes=half_axes, pose=pose)


def _footprint(superquadric: FittedSuperquadric, axis: int) -> Float64:
    """Places (P, 3) of the world at the height of its centre, over most of its width."""
    places = np.linspace(MINORITY - 1, 1 - MINORITY, EDGE_POINTS)
    local = np.zeros((EDGE_POINTS**2, 3))
    first, second = (k for k in range(3) if k != axis)
    local[:, first], local[:, second] = (
        one_side.ravel() for one_side in np.meshgrid(places, places)
    )
    return np.asarray(
        (local * superquadric.half_axes) @ superquadric.pose.rotation.T + superquadric.pose.position
    )
