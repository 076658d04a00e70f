"""Exact signed distances to a union of convex solids, point by point."""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from scenefw.core.types import Float64, TriangleMesh
from scenefw.shapes.things.union import polytope


def signed_distances(points: Float64, solids: Sequence[Float64], boundary: TriangleMesh) -> Float64:
    """Distances (N,) in metres of points (N, 3), negative inside.

    Args:
        points: m.
        solids: corners (K, 3) of the convex solids, which say what is inside.
        boundary: of their union, which says how far it is.
    """
    planes = [polytope(corners).planes for corners in solids]
    ends = np.cumsum([len(sides) for sides in planes])
    corners = boundary.vertices[boundary.faces]
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    flat = np.ascontiguousarray(np.asarray(points, dtype=np.float64).reshape(-1, 3))
    return np.asarray(_distances(flat, corners, centres, radii, np.concatenate(planes), ends))


@njit(cache=True)
def _inside(point, planes, ends):
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
def _squared_distance(p, a, b, c):
    """From a point to a triangle (Ericson, Real-Time Collision Detection, 5.1.5)."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = np.dot(ab, ap), np.dot(ac, ap)
    bp, cp = p - b, p - c
    d3, d4 = np.dot(ab, bp), np.dot(ac, bp)
    d5, d6 = np.dot(ab, cp), np.dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        offset = ap
    elif d3 >= 0 and d4 <= d3:
        offset = bp
    elif d6 >= 0 and d5 <= d6:
        offset = cp
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        offset = ap - ab * (d1 / (d1 - d3))
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        offset = ap - ac * (d2 / (d2 - d6))
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        offset = bp - (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
    else:
        scale = 1.0 / (va + vb + vc)
        offset = ap - ab * (vb * scale) - ac * (vc * scale)
    return np.dot(offset, offset)


@njit(cache=True)
def _distances(points, corners, centres, radii, planes, ends):
    distances = np.empty(len(points))
    for i in range(len(points)):
        point, best = points[i], np.inf
        for k in range(len(corners)):
            bound = np.sqrt(best) + radii[k]
            gap = point - centres[k]
            if np.dot(gap, gap) < bound * bound:
                best = min(
                    best, _squared_distance(point, corners[k, 0], corners[k, 1], corners[k, 2])
                )
        distances[i] = -np.sqrt(best) if _inside(point, planes, ends) else np.sqrt(best)
    return distances
