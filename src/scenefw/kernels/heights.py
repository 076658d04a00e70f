"""Heights of a triangular mesh by least squares: sums of measurements, Gauss-Seidel, all levels.

Per vertex a record of `RECORD` float32 sums over the measurements about it, weights included:

    0 diagonal of J'J | 1, 2, 3 its entries with the vertex to the right, below, and both
    4 J'z | 5 weights | 6 weighted z^2 | 7, 8, 9 weighted red, green, blue | 10 weights of colours

That is all of the normal equations (eq. 4.2): triangles of a regular mesh couple a vertex with six
neighbours, and each coupling is kept once. Bands of rows are swept side by side with the rows next
to them as they were before the round, so that results don't depend on the number of threads. Beyond
the edges of a level its vertices meet others that nothing couples: no sweep need look for edges.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, atomic_add, element, loop
from scenefw.kernels.triangles import SEEN, UNSEEN, corners, level_of, parents, rows_of

RECORD = 11
MERGED = 6
_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_QUARTER = np.float32(0.25)
_ONE = np.float32(1)
_PULL = np.float32(1e-3)  # keeps vertices apart that measurements only fix together


@element
def _add_vertex(sums, vertex, weight, share, z, red, green, blue, coloured):
    at = vertex * RECORD
    w = weight * share
    atomic_add(sums, at, w * share)
    atomic_add(sums, at + 4, w * z)
    atomic_add(sums, at + 5, w)
    atomic_add(sums, at + 6, w * z * z)
    if coloured:
        atomic_add(sums, at + 7, w * red)
        atomic_add(sums, at + 8, w * green)
        atomic_add(sums, at + 9, w * blue)
        atomic_add(sums, at + 10, w)


@element
def _add_far(far, vertex, share, z):
    atomic_add(far, 2 * vertex, share)
    atomic_add(far, 2 * vertex + 1, share * z)


@element
def _add_pixel(pixel, cells, spots, colour, sums, heights, far, n, outlier):
    """Adds a pixel's equation (4.1), by Huber's weight, to the equations of its three vertices."""
    cell = cells[pixel]
    f, g, z = spots[pixel, 0], spots[pixel, 1], spots[pixel, 2]
    middle, a, b, c = corners(cell, f, g, n)
    last = cell + n + 1
    surface = a * heights[cell] + b * heights[middle] + c * heights[last]
    w, distance = _ONE, abs(z - surface)
    if distance > outlier and surface < SEEN:
        w = outlier / distance
        _add_far(far, cell, a, z)
        _add_far(far, middle, b, z)
        _add_far(far, last, c, z)
    coloured = len(colour) > 0
    red, green, blue = _ZERO, _ZERO, _ZERO
    if coloured:
        red = np.float32(colour[3 * pixel])
        green = np.float32(colour[3 * pixel + 1])
        blue = np.float32(colour[3 * pixel + 2])
    _add_vertex(sums, cell, w, a, z, red, green, blue, coloured)
    _add_vertex(sums, middle, w, b, z, red, green, blue, coloured)
    _add_vertex(sums, last, w, c, z, red, green, blue, coloured)
    right = 1 if middle == cell + 1 else 2  # first to middle; middle to last goes the other way
    atomic_add(sums, cell * RECORD + right, w * a * b)
    atomic_add(sums, middle * RECORD + 3 - right, w * b * c)
    atomic_add(sums, cell * RECORD + 3, w * a * c)


@element
def _add(i, bands, order, starts, work, layout, cells, spots, colour, sums, heights, far, outlier):
    if bands[i] >= 0:
        n = layout[level_of(bands[i], layout), 1]
        _add_pixel(i, cells, spots, colour, sums, heights, far, n, outlier)


@loop
def _add_all(
    count, bands, order, starts, work, layout, cells, spots, colour, sums, heights, far, outlier
):
    for parity in range(2):
        for k in prange(work[parity, 0]):
            band = work[parity, np.int64(k) + 1]
            n = layout[level_of(band, layout), 1]
            for j in range(starts[band], starts[band + 1]):
                _add_pixel(order[j], cells, spots, colour, sums, heights, far, n, outlier)


@element
def _begin(i, bands, layout, boxes, sums, heights):
    """Vertices of a band touched for the first time start at the mean of what touches them."""
    first, n, top, bottom, level = rows_of(bands[i], layout)
    for row in range(top, bottom):
        for column in range(boxes[level, 2], boxes[level, 3]):
            vertex = first + row * n + column
            weight = sums[vertex * RECORD + 5]
            if weight > _ZERO and heights[vertex] == UNSEEN:
                heights[vertex] = sums[vertex * RECORD + 4] / weight


@loop
def _begin_all(count, bands, layout, boxes, sums, heights):
    for i in prange(count):
        _begin(np.int64(i), bands, layout, boxes, sums, heights)


@element
def _relax_row(row, above, below, sums, heights, first, n, left, right, damping):
    """One Gauss-Seidel step (eq. 4.2) of a row's vertices; rows next to it at `above`, `below`."""
    for start in range(left, min(left + 2, right)):  # every second vertex: none waits for another
        for column in range(start, right, 2):
            vertex = first + row * n + column
            at = vertex * RECORD
            weight = sums[at + 5]
            if weight > _ZERO:
                diagonal = sums[at]
                pull = max(damping - diagonal, _PULL * diagonal)
                numerator = sums[at + 4]
                numerator += pull * numerator / weight
                numerator -= sums[at + 1] * heights[vertex + 1]
                numerator -= sums[at + 2] * heights[below + vertex + n]
                numerator -= sums[at + 3] * heights[below + vertex + n + 1]
                numerator -= sums[at - RECORD + 1] * heights[vertex - 1]
                numerator -= sums[at - n * RECORD + 2] * heights[above + vertex - n]
                numerator -= sums[at - n * RECORD - RECORD + 3] * heights[above + vertex - n - 1]
                heights[vertex] = numerator / (diagonal + pull)


@element
def _relax(i, bands, layout, boxes, sums, heights, damping):
    """Sweeps down and up a band; its neighbours' rows lie in the second half of `heights`."""
    first, n, top, bottom, level = rows_of(bands[i], layout)
    left, right = np.int64(boxes[level, 2]), np.int64(boxes[level, 3])
    before = len(heights) // 2
    for k in range(2 * (bottom - top)):
        row = top + k if k < bottom - top else 2 * bottom - top - 1 - k
        above = before if row == top else 0
        below = before if row == bottom - 1 else 0
        _relax_row(row, above, below, sums, heights, first, n, left, right, damping)


@loop
def _relax_all(count, bands, layout, boxes, sums, heights, damping):
    for i in prange(count):
        _relax(np.int64(i), bands, layout, boxes, sums, heights, damping)


@element
def _mix(mine, w, theirs, v):
    return (w * mine + v * theirs) / (w + v)


@element
def _merge_at(row, column, sums, heights, coarse, merged, level, prior):
    """Height, confidence, variance and colour of a vertex from its level and the coarser ones."""
    first, n, below = level
    vertex = first + row * n + column
    to = (row * n + column) * MERGED
    at = vertex * RECORD
    weight, tinted = sums[at + 5], sums[at + 10]
    above, has_prior = _ZERO, False
    p, q = 0, 0
    if below > 0:
        p, q = parents(row, column, below)
        p *= MERGED
        q *= MERGED
        has_prior = max(coarse[p], coarse[q]) < SEEN
    if has_prior:
        above = _QUARTER * _HALF * (coarse[p + 1] + coarse[q + 1])
    if not has_prior and not weight > _ZERO:
        merged[to] = UNSEEN
        merged[to + 1] = _ZERO
        merged[to + 2] = _ZERO
        merged[to + 3], merged[to + 4], merged[to + 5] = _ZERO, _ZERO, _ZERO
        return
    share = min(prior, above) if weight > _ZERO else _ONE
    merged[to + 1] = weight + above
    height, variance = _ZERO, _ZERO
    if weight > _ZERO:
        height = heights[vertex]
        mean = sums[at + 4] / weight
        variance = max(sums[at + 6] / weight - mean * mean, _ZERO)
        variance += (mean - height) * (mean - height)
    if has_prior:
        height = _mix(height, weight, _HALF * (coarse[p] + coarse[q]), share)
        variance = _mix(variance, weight, _HALF * (coarse[p + 2] + coarse[q + 2]), share)
    merged[to] = height
    merged[to + 2] = variance
    for k in range(3):
        colour = sums[at + 7 + k] / tinted if tinted > _ZERO else _ZERO
        if has_prior:
            tint = _HALF * (coarse[p + 3 + k] + coarse[q + 3 + k])
            colour = _mix(colour, tinted, tint, share) if tinted > _ZERO else tint
        merged[to + 3 + k] = colour


@element
def _merge(i, sums, heights, coarse, merged, level, prior):
    n = level[1]
    _merge_at(i // n, i % n, sums, heights, coarse, merged, level, prior)


@loop
def _merge_all(count, sums, heights, coarse, merged, level, prior):
    n = level[1]
    for row in prange(n):
        for column in range(n):
            _merge_at(np.int64(row), column, sums, heights, coarse, merged, level, prior)


add = Kernel(_add, _add_all)
begin = Kernel(_begin, _begin_all)
relax = Kernel(_relax, _relax_all)
merge = Kernel(_merge, _merge_all)
