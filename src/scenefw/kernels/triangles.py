"""Where depth pixels land on a triangular mesh over the table, at which of its levels of detail.

A level has n x n vertices, row by row from the largest y, and splits each of its cells by the
diagonal from vertex (row, column) to (row + 1, column + 1). Levels lie one after the other, finest
first, padded by what a row and a vertex beyond their ends need; `layout` (L, 3) int32 holds the
first vertex, n and the first band of each. A band is
`BAND_ROWS` rows of cells of one level: what lands in two bands of equal parity meets no vertex in
common, so that threads may add to them side by side, each in the order of the pixels.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN201, ANN202

import math

import numba
import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop
from scenefw.kernels.rays import direction

BAND_ROWS = 16
UNSEEN = np.float32(1e30)
"""Height of a vertex that nothing was seen of; finite, as times a coupling of 0 it must be 0."""

SEEN = np.float32(1e20)
"""Heights (m) of vertices of which something was seen are less."""

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_ONE = np.float32(1)
_TWO = np.float32(2)
_FOUR = np.float32(4)


@element
def _locate_at(u, v, depth, intrinsics, poses, layout, bands, cells, spots, width, box):
    """Band, first vertex of the cell, and (row, column in the cell, z, cosine) of one pixel."""
    lower_x, upper_y, per_metre, area, max_height = box
    pixel = v * width + u
    bands[pixel] = -1
    z = depth[pixel]
    if not z > _ZERO:
        return
    wx, wy, wz = direction(intrinsics, poses, 0, u, v)
    x, y, high = poses[0, 0, 3] + z * wx, poses[0, 1, 3] + z * wy, poses[0, 2, 3] + z * wz
    drop = abs(z * wz)
    # Pixels that a horizontal triangle covers here, from the derivative of the projection.
    covered = _HALF * drop * intrinsics[0, 0] * intrinsics[0, 1]
    covered /= per_metre * per_metre * z * z * z
    level, scale = 0, per_metre
    while level < len(layout) - 1 and covered * _FOUR <= _TWO * area:
        covered *= _FOUR
        scale *= _HALF
        level += 1
    row, column = (upper_y - y) * scale, (x - lower_x) * scale
    n = layout[level, 1]
    last = np.float32(n - 1)
    if not (row >= _ZERO and column >= _ZERO and row <= last and column <= last):
        return
    if not abs(high) <= max_height:
        return
    r, c = min(int(row), n - 2), min(int(column), n - 2)
    bands[pixel] = layout[level, 2] + r // BAND_ROWS
    cells[pixel] = layout[level, 0] + r * n + c
    spots[pixel, 0] = row - np.float32(r)
    spots[pixel, 1] = column - np.float32(c)
    spots[pixel, 2] = high
    spots[pixel, 3] = drop / (z * math.sqrt(wx * wx + wy * wy + wz * wz))


@element
def _locate(i, depth, intrinsics, poses, layout, bands, cells, spots, width, box):
    _locate_at(
        i % width, i // width,
        depth, intrinsics, poses, layout, bands, cells, spots, width, box,
    )  # fmt: skip


@loop
def _locate_all(count, depth, intrinsics, poses, layout, bands, cells, spots, width, box):
    for v in prange(count // width):
        for u in range(width):
            _locate_at(
                u, np.int64(v), depth, intrinsics, poses, layout, bands, cells, spots, width, box
            )


@element
def corners(cell, f, g, n):
    """Of a point in a cell: its triangle's middle vertex and the weights of first, middle, last.

    The first vertex is `cell`, the last one `cell + n + 1`; the middle one lies to the right of the
    first (`cell + 1`) or below it (`cell + n`).
    """
    middle = cell + 1 if g >= f else cell + n
    return middle, _ONE - max(f, g), abs(f - g), min(f, g)


@element
def level_of(band, layout):
    """The level that a band belongs to."""
    level = 0
    while level + 1 < len(layout) and band >= layout[level + 1, 2]:
        level += 1
    return level


@element
def rows_of(band, layout):
    """First vertex and side of a band's level, its rows from the first to the end, its level."""
    level = level_of(band, layout)
    first, n = np.int64(layout[level, 0]), np.int64(layout[level, 1])
    top = np.int64(band - layout[level, 2]) * BAND_ROWS
    return first, n, top, n if top + BAND_ROWS >= n - 1 else top + BAND_ROWS, level


@element
def parents(row, column, coarse):
    """The two vertices of the next coarser level between which a vertex lies, maybe the same."""
    first = (row // 2) * coarse + column // 2
    return first, first + (row % 2) * coarse + column % 2


@numba.njit(cache=True)
def order_by_band(bands, cells, layout, order, starts, work, touched, boxes):
    """Sorts pixels by band, keeping their order within; lists bands and each level's box.

    Returns how many bands hold vertices of the pixels' triangles.

    Args:
        bands: (N,) of `locate`.
        cells: (N,) of `locate`.
        layout: (L, 3).
        order: (N,) int32, filled with the pixels that landed.
        starts: (B + 1,) int32, filled with where each band starts in `order`.
        work: (2, B + 1) int32, filled per parity with the number of bands to do, then the bands.
        touched: (B,) int32, filled with the bands that hold vertices of the pixels' triangles; the
            vertices of a band are its first `BAND_ROWS` rows, in a level's last band all.
        boxes: (L, 4) int32, filled with the rows and columns of the vertices that were touched,
            (first row, end, first column, end); empty boxes have end 0.
    """
    total = len(starts) - 1
    starts[:] = 0
    for pixel in range(len(bands)):
        if bands[pixel] >= 0:
            starts[bands[pixel] + 1] += 1
    work[:, 0] = 0
    for band in range(total):
        if starts[band + 1] > 0:
            work[band % 2, 0] += 1
            work[band % 2, work[band % 2, 0]] = band
        starts[band + 1] += starts[band]
    boxes[:, 0], boxes[:, 1], boxes[:, 2], boxes[:, 3] = 1 << 30, 0, 1 << 30, 0
    filled = starts[:-1].copy()
    for pixel in range(len(bands)):
        band = bands[pixel]
        if band >= 0:
            order[filled[band]] = pixel
            filled[band] += 1
            level = level_of(band, layout)
            at = np.uint32(cells[pixel] - layout[level, 0])
            n = np.uint32(layout[level, 1])
            row = np.int32(at // n)
            column = np.int32(at - at // n * n)
            boxes[level, 0] = min(boxes[level, 0], row)
            boxes[level, 1] = max(boxes[level, 1], row + 2)
            boxes[level, 2] = min(boxes[level, 2], column)
            boxes[level, 3] = max(boxes[level, 3], column + 2)
    touched_count = 0
    for band in range(total):
        is_same_level = band > 0 and level_of(band - 1, layout) == level_of(band, layout)
        if starts[band + 1] > starts[band] or (is_same_level and starts[band] > starts[band - 1]):
            touched[touched_count] = band
            touched_count += 1
    return touched_count


locate = Kernel(_locate, _locate_all)
