"""Rays through the triangles of a height map: which vertex does each pixel of a camera see?

A ray walks from cell to cell of the finest level between the lowest and the highest vertex and is
cut with both triangles of each; triangles with an unseen vertex (`UNSEEN`) let it pass.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop
from scenefw.kernels.rays import direction
from scenefw.kernels.triangles import SEEN

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_ONE = np.float32(1)
_NEVER = np.float32(1e30)
_NEAREST = np.float32(1e-3)  # metres before the camera
_TINY = np.float32(1e-9)
_SLACK = np.float32(1e-3)  # of a cell, so that rays don't slip through between triangles


@element
def _clip(origin, slope, low, high, enter, leave):
    """Narrows the part of a ray between two planes along one axis."""
    if abs(slope) < _TINY:
        return enter, -_ONE if origin < low or origin > high else leave
    first, second = (low - origin) / slope, (high - origin) / slope
    return max(enter, min(first, second)), min(leave, max(first, second))


@element
def _intersect_triangle(base, over_row, over_column, upper, start, slopes):
    """Where a ray meets one triangle of a cell, from the cell's first vertex; _NEVER if not."""
    row, column, z = start
    down, right, rise = slopes
    t = (base + row * over_row + column * over_column - z) / (
        rise - down * over_row - right * over_column
    )
    f, g = row + t * down, column + t * right
    inside = min(f, g) >= -_SLACK and max(f, g) <= _ONE + _SLACK
    right_side = g >= f - _SLACK if upper else f >= g - _SLACK
    return t if inside and right_side else _NEVER


@element
def _meet(heights, n, row, column, start, slopes):
    """The first of a cell's triangles that a ray meets, as a multiple of the ray."""
    at = row * n + column
    a, b, c, d = heights[at], heights[at + 1], heights[at + n], heights[at + n + 1]
    local_start = (start[0] - np.float32(row), start[1] - np.float32(column), start[2])
    first, second = _NEVER, _NEVER
    if max(a, b, d) < SEEN:
        first = _intersect_triangle(a, d - b, b - a, True, local_start, slopes)
    if max(a, c, d) < SEEN:
        second = _intersect_triangle(a, c - a, d - c, False, local_start, slopes)
    return min(first, second)


@element
def _cross(origin, slope, cell):
    """Multiple of a ray at which it leaves a cell along one axis."""
    if abs(slope) < _TINY:
        return _NEVER
    return (np.float32(cell + 1 if slope > _ZERO else cell) - origin) / slope


@element
def _cast_at(u, v, intrinsics, poses, heights, depth, vertices, width, n, box):
    lower_x, upper_y, per_metre, low, high = box
    pixel = v * width + u
    depth[pixel] = _ZERO
    vertices[pixel] = -1
    wx, wy, rise = direction(intrinsics, poses, 0, u, v)
    down, right = -wy * per_metre, wx * per_metre
    row0, column0 = (upper_y - poses[0, 1, 3]) * per_metre, (poses[0, 0, 3] - lower_x) * per_metre
    z0, last = poses[0, 2, 3], np.float32(n - 1)
    enter, leave = _clip(row0, down, _ZERO, last, _NEAREST, _NEVER)
    enter, leave = _clip(column0, right, _ZERO, last, enter, leave)
    enter, leave = _clip(z0, rise, low, high, enter, leave)
    if not enter <= leave:
        return
    start = (row0 + enter * down, column0 + enter * right, z0 + enter * rise)
    slopes = (down, right, rise)
    leave -= enter
    row = min(max(int(start[0]), 0), n - 2)
    column = min(max(int(start[1]), 0), n - 2)
    for _ in range(2 * n):
        t = _meet(heights, n, row, column, start, slopes)
        if t < _NEVER and t > -enter:
            depth[pixel] = enter + t
            r = min(max(int(start[0] + t * down + _HALF), 0), n - 1)
            c = min(max(int(start[1] + t * right + _HALF), 0), n - 1)
            vertices[pixel] = r * n + c
            return
        to_row, to_column = _cross(start[0], down, row), _cross(start[1], right, column)
        if min(to_row, to_column) > leave:
            return
        if to_row < to_column:
            row += 1 if down > _ZERO else -1
        else:
            column += 1 if right > _ZERO else -1
        if min(row, column) < 0 or max(row, column) > n - 2:
            return


@element
def _cast(i, intrinsics, poses, heights, depth, vertices, width, n, box):
    _cast_at(i % width, i // width, intrinsics, poses, heights, depth, vertices, width, n, box)


@loop
def _cast_all(count, intrinsics, poses, heights, depth, vertices, width, n, box):
    for v in prange(count // width):
        for u in range(width):
            _cast_at(u, np.int64(v), intrinsics, poses, heights, depth, vertices, width, n, box)


cast = Kernel(_cast, _cast_all)
