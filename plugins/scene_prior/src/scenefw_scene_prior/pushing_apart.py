"""Solids that run into each other or into the floor, moved until they touch at most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from scenefw.core.types import Float64, PlacedShape, Pose
from scenefw.shapes.superquadric import Superquadric

_CORNERS = 10  # of meshes that say how deep a shape is in another
_STEP = 1e-4  # m, of differences


def pushed_apart(
    objects: Sequence[PlacedShape], deepest: float = 5e-4, rounds: int = 100
) -> list[PlacedShape]:
    """Superquadrics moved, not turned, out of each other and out of the floor.

    In each round every pair moves apart along the normal where one is deepest in the other, each
    by half of that depth, and what is in the floor rises.

    Args:
        objects: superquadrics and where they are.
        deepest: how far shapes may stay in each other (m).
        rounds: at most.
    """
    shapes = [_superquadric(item) for item in objects]
    surfaces = [shape.mesh(_CORNERS).vertices for shape in shapes]
    turns = [item.pose.rotation for item in objects]
    places = np.array([item.pose.position for item in objects], dtype=np.float64).reshape(-1, 3)
    for _ in range(rounds):
        largest_move = 0.0
        for a, b in combinations(range(len(objects)), 2):
            push = _push_out(shapes, surfaces, turns, places, a, b)
            counter_push = _push_out(shapes, surfaces, turns, places, b, a)
            push = push if np.linalg.norm(push) >= np.linalg.norm(counter_push) else -counter_push
            places[a] += push / 2
            places[b] -= push / 2
            largest_move = max(largest_move, float(np.linalg.norm(push)))
        for k, surface in enumerate(surfaces):
            depth_below = float(-(surface @ turns[k][2]).min() - places[k, 2])
            places[k, 2] += max(depth_below, 0.0)
            largest_move = max(largest_move, depth_below)
        if largest_move <= deepest:
            break
    return [
        replace(item, pose=Pose(place, item.pose.quaternion))
        for item, place in zip(objects, places, strict=True)
    ]


def _push_out(
    shapes: Sequence[Superquadric],
    surfaces: Sequence[Float64],
    turns: Sequence[Float64],
    places: Float64,
    a: int,
    b: int,
) -> Float64:
    """Which way (3,) object a must go for its deepest point to leave object b (m)."""
    reach = np.linalg.norm(shapes[a].half_axes) + np.linalg.norm(shapes[b].half_axes)
    if np.linalg.norm(places[a] - places[b]) > reach:
        return np.zeros(3)
    points = (surfaces[a] @ turns[a].T + places[a] - places[b]) @ turns[b]
    depths = -shapes[b].first_order_distance(points)
    deepest = int(depths.argmax())
    if depths[deepest] <= 0:
        return np.zeros(3)
    neighbours = points[deepest] + _STEP * np.concatenate([np.eye(3), -np.eye(3)])
    values = shapes[b].first_order_distance(neighbours)
    normal = (values[:3] - values[3:]) @ turns[b].T
    return np.asarray(depths[deepest] * normal / max(np.linalg.norm(normal), 1e-9))


def _superquadric(item: PlacedShape) -> Superquadric:
    if not isinstance(item.shape, Superquadric):
        raise TypeError(f"expected superquadrics, not {type(item.shape).__name__}")
    return item.shape
