"""Distances of places to triangles in the tree of `meshes`, one place per element."""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop

_ZERO, _ONE = np.float32(0), np.float32(1)
_TINY = np.float32(1e-30)
FARTHEST = 1e15
"""m: a limit whose square is a float32."""


@element
def _to_box(bounds, node, x, y, z):
    """Squared distance of a place from a box."""
    dx = max(max(bounds[node, 0] - x, x - bounds[node, 3]), _ZERO)
    dy = max(max(bounds[node, 1] - y, y - bounds[node, 4]), _ZERO)
    dz = max(max(bounds[node, 2] - z, z - bounds[node, 5]), _ZERO)
    return dx * dx + dy * dy + dz * dz


@element
def _ratio(part, whole):
    """How far along a side a place lies, between its ends; 0 on sides without length."""
    return min(max(part / whole, _ZERO), _ONE) if whole > _TINY else _ZERO


@element
def _to_side(px, py, pz, sx, sy, sz):
    """Squared distance of a place from a side that begins at the origin."""
    t = _ratio(px * sx + py * sy + pz * sz, sx * sx + sy * sy + sz * sz)
    dx, dy, dz = px - t * sx, py - t * sy, pz - t * sz
    return dx * dx + dy * dy + dz * dz


@element
def _to_triangle(triangles, k, x, y, z):
    """Squared distance of a place from a triangle: from its plane, else from its sides."""
    px, py, pz = x - triangles[k, 0], y - triangles[k, 1], z - triangles[k, 2]
    ax, ay, az = triangles[k, 3], triangles[k, 4], triangles[k, 5]
    bx, by, bz = triangles[k, 6], triangles[k, 7], triangles[k, 8]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    area = nx * nx + ny * ny + nz * nz
    qx, qy, qz = py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx
    v = ax * qx + ay * qy + az * qz
    u = -(bx * qx + by * qy + bz * qz)
    if area > _ZERO and u >= _ZERO and v >= _ZERO and u + v <= area:
        height = px * nx + py * ny + pz * nz
        return height * height / area
    first = _to_side(px, py, pz, ax, ay, az)
    second = _to_side(px, py, pz, bx, by, bz)
    third = _to_side(px - ax, py - ay, pz - az, bx - ax, by - ay, bz - az)
    return min(first, min(second, third))


@element
def _approach(i, bounds, links, triangles, places, limit, distance):
    x, y, z = places[i, 0], places[i, 1], places[i, 2]
    best, node = limit * limit, 0
    while node < len(links):
        if _to_box(bounds, node, x, y, z) >= best:
            node = links[node, 0]
            continue
        first = links[node, 1]
        for k in range(first, first + links[node, 2]):
            best = min(best, _to_triangle(triangles, k, x, y, z))
        node += 1
    distance[i] = np.sqrt(best)


@loop
def _approach_all(count, bounds, links, triangles, places, limit, distance):
    for i in prange(count):
        _approach(np.int64(i), bounds, links, triangles, places, limit, distance)


approach = Kernel(
    _approach,
    _approach_all,
    types="i8, f4[:, ::1], i4[:, ::1], f4[:, ::1], f4[:, ::1], f4, f4[::1]",
)
"""approach(P, bounds, links, triangles, places (P, 3), limit, distance (P,)): how near a place is
to the nearest triangle (m), at most `limit`."""
