"""Unions of convex parts: their planes, what is inside, and points on their surface."""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN201, ANN202

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from scipy.spatial import ConvexHull

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float64

_EQUAL_DIGITS = 9  # of the planes of triangles that are one side
_OUTSIDE = 1e-5  # m: a place so far before a side that lies in another part is inside the union
_ROUNDS = 8  # of candidates, each twice as many as points are needed


def planes_of(corners: Float64) -> Float64:
    """Planes (K, 4) of a convex part: planes[:, :3] @ x + planes[:, 3] <= 0 inside."""
    return np.unique(ConvexHull(corners).equations.round(_EQUAL_DIGITS), axis=0)


def ball_about(corners: Float64) -> Float64:
    """Centre and radius (4,) of a ball about points (K, 3)."""
    centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return np.array([*centre, np.linalg.norm(corners - centre, axis=1).max()])


def inside(points: Float64, parts: Sequence[Float64]) -> NDArray[np.bool_]:
    """Which points (N, 3) lie in one of the parts, each given by its planes (K, 4)."""
    if not parts:
        return np.zeros(len(points), dtype=bool)
    ends = np.cumsum([len(planes) for planes in parts])
    return np.asarray(_all_inside(np.ascontiguousarray(points), np.concatenate(parts), ends))


@njit(cache=True)
def is_inside(point, planes, ends):
    """Whether a point lies in one of the parts whose planes are up to `ends`."""
    start = 0
    for end in ends:
        within = True
        for k in range(start, end):
            height = planes[k, 3]
            for axis in range(3):
                height += planes[k, axis] * point[axis]
            if height > 0:
                within = False
                break
        if within:
            return True
        start = end
    return False


@njit(cache=True)
def _all_inside(points, planes, ends):
    mask = np.empty(len(points), np.bool_)
    for i in range(len(points)):
        mask[i] = is_inside(points[i], planes, ends)
    return mask


def surface_points(
    corners: Sequence[Float64], parts: Sequence[Float64], count: int, rng: np.random.Generator
) -> Float64:
    """Points (count, 3) on the surface of the union, uniform by area; zeros without parts.

    Args:
        corners: (K, 3) of each part (m).
        parts: their planes.
        count: of points.
        rng: random.
    """
    if not corners or not count:
        return np.zeros((count, 3))
    hulls = [ConvexHull(part) for part in corners]
    triangles = np.concatenate([hull.points[hull.simplices] for hull in hulls])
    normals = np.concatenate([hull.equations[:, :3] for hull in hulls])
    points = np.zeros((0, 3))
    for _ in range(_ROUNDS):
        candidates, faces = points_on(triangles, 2 * count, rng)
        free = ~inside(candidates + _OUTSIDE * normals[faces], parts)
        points = np.concatenate([points, candidates[free]])
        if len(points) >= count:
            break
    return np.resize(points, (count, 3))


def points_on(
    triangles: Float64, count: int, rng: np.random.Generator
) -> tuple[Float64, NDArray[np.int64]]:
    """Points (count, 3) on triangles (F, 3, 3), uniform by area, and whose each is."""
    a, b, c = triangles.transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    faces = rng.choice(len(areas), count, p=areas / areas.sum())
    root, v = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    points = (1 - root) * a[faces] + root * ((1 - v) * b[faces] + v * c[faces])
    return points, faces
