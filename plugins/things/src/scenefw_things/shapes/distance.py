"""Exact signed distances to a union of convex solids, point by point."""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from scenefw.core.types import Float64, TriangleMesh
from scenefw_things.shapes.part_unions import is_inside
from scenefw_things.shapes.union import polytope


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
    rows = np.concatenate([corners[:, :1], corners[:, 1:] - corners[:, :1]], axis=1).reshape(-1, 9)
    centres = corners.mean(axis=1)
    radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    flat = np.ascontiguousarray(np.asarray(points, dtype=np.float64).reshape(-1, 3))
    bounds, _ = cKDTree(boundary.vertices).query(flat)
    balls = np.column_stack([centres, radii])
    return np.asarray(_distances(flat, bounds, rows, balls, np.concatenate(planes), ends))


@njit(cache=True)
def _dot(a0, a1, a2, b0, b1, b2):
    return a0 * b0 + a1 * b1 + a2 * b2


@njit(cache=True)
def _squared_distance(px, py, pz, row):
    """From a point to a triangle: a corner and the sides to the others (Ericson 2005, 5.1.5)."""
    bx, by, bz, cx, cy, cz = row[3], row[4], row[5], row[6], row[7], row[8]
    x, y, z = px - row[0], py - row[1], pz - row[2]
    bb, bc = _dot(bx, by, bz, bx, by, bz), _dot(bx, by, bz, cx, cy, cz)
    cc = _dot(cx, cy, cz, cx, cy, cz)
    d1, d2 = _dot(bx, by, bz, x, y, z), _dot(cx, cy, cz, x, y, z)
    d3, d4, d5, d6 = d1 - bb, d2 - bc, d1 - bc, d2 - cc  # the same, from the other corners
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    u, v = 0.0, 0.0  # shares of both sides on the way to the nearest place
    if d1 <= 0 and d2 <= 0:
        pass
    elif d3 >= 0 and d4 <= d3:
        u = 1.0
    elif d6 >= 0 and d5 <= d6:
        v = 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        u = d1 / (d1 - d3)
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        v = d2 / (d2 - d6)
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        v = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        u = 1 - v
    else:
        u, v = vb / (va + vb + vc), vc / (va + vb + vc)
    x, y, z = x - u * bx - v * cx, y - u * by - v * cy, z - u * bz - v * cz
    return x * x + y * y + z * z


@njit(cache=True)
def _distances(points, bounds, rows, balls, planes, ends):
    """Signed distances, given distances to some place of the surface and balls about triangles."""
    distances = np.empty(len(points))
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        nearest = bounds[i]
        best = nearest * nearest
        for k in range(len(rows)):
            dx, dy, dz = x - balls[k, 0], y - balls[k, 1], z - balls[k, 2]
            reach = nearest + balls[k, 3]
            if dx * dx + dy * dy + dz * dz < reach * reach:
                squared = _squared_distance(x, y, z, rows[k])
                if squared < best:
                    best = squared
                    nearest = np.sqrt(best)
        distances[i] = -nearest if is_inside(points[i], planes, ends) else nearest
    return distances
