"""Heights that rival those of a mesh: what was measured far from the surface, and when it wins.

A robust weight holds measurements against the surface known so far. Were that the first one for
good, a bad first frame would weigh down all that follow. So each vertex has a rival, `rivals`
(vertices, 2) float32: a height and the weight of the votes for it. What a frame measures far from
the surface votes for the rival if it is near that, else against it (the vote for a majority of
Boyer and Moore 1991); a rival voted down is replaced. The frame that names a rival has no vote for
it: no single frame wins. A rival of more weight than what speaks for the surface takes over: the
vertex' sums (`kernels.heights`) shrink to what Huber's loss gives them about the new height, the
votes join them as measurements at the vertex, and the height of before becomes the rival.

`far` (vertices, 2) float32 is 0 between frames. Within one it holds the weights of the far
measurements at a vertex and their sum of weight times height; then, where a rival wins, the factor
by which sums shrink. `wins` int32 counts those per band.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, atomic_add, element, loop
from scenefw.kernels.heights import RECORD
from scenefw.kernels.triangles import SEEN, rows_of

_ZERO = np.float32(0)
_ONE = np.float32(1)


@element
def _vote_at(vertex, sums, heights, far, rivals, outlier):
    """Counts the votes of a frame at a vertex; the factor of its sums if the rival wins, else 0."""
    votes = far[2 * vertex]
    mean = far[2 * vertex + 1] / votes
    height, rival, weight = heights[vertex], rivals[2 * vertex], rivals[2 * vertex + 1]
    if not height < SEEN or abs(mean - height) <= outlier:
        return _ZERO
    if abs(mean - rival) <= outlier:
        rival = (weight * rival + votes * mean) / (weight + votes)
        weight += votes
    else:
        weight -= votes
        rival = mean if weight <= _ZERO else rival
        weight = max(weight, _ZERO)
    distance = abs(rival - height)
    if distance <= outlier:  # the surface has come to it
        weight = _ZERO
    rivals[2 * vertex], rivals[2 * vertex + 1] = rival, weight
    factor = outlier / distance  # of its votes, which the sums hold already
    return factor if weight + factor * weight > sums[vertex * RECORD + 5] else _ZERO


@element
def _vote(i, bands, layout, boxes, sums, heights, far, rivals, wins, outlier):
    first, n, top, bottom, level = rows_of(bands[i], layout)
    win_count = 0
    for row in range(top, bottom):
        for column in range(boxes[level, 2], boxes[level, 3]):
            vertex = first + row * n + column
            if far[2 * vertex] > _ZERO:
                factor = _vote_at(vertex, sums, heights, far, rivals, outlier)
                far[2 * vertex], far[2 * vertex + 1] = factor, _ZERO
                win_count += factor > _ZERO
    wins[i] = win_count


@loop
def _vote_all(count, bands, layout, boxes, sums, heights, far, rivals, wins, outlier):
    for i in prange(count):
        _vote(np.int64(i), bands, layout, boxes, sums, heights, far, rivals, wins, outlier)


@element
def _loosen(vertex, entry, first, second, sums, far):
    """Weighs down the coupling of `first` to `second`, at `entry` of the record of `first`.

    What a coupling loses both diagonals gain: rows of the equations keep their sums, so that a
    level surface stays exact, and the matrix stays positive.
    """
    at = first * RECORD + entry
    coupling, factor = sums[at], far[2 * vertex]
    if first != vertex and far[2 * first] > _ZERO:
        return  # done from there
    if second != vertex and far[2 * second] > _ZERO:
        factor = min(factor, far[2 * second])
    loss = (_ONE - factor) * coupling
    sums[at] = coupling - loss
    atomic_add(sums, first * RECORD, loss)
    atomic_add(sums, second * RECORD, loss)


@element
def _give_way(vertex, n, sums, heights, far, rivals):
    """The rival of a vertex takes over."""
    _loosen(vertex, 1, vertex, vertex + 1, sums, far)
    _loosen(vertex, 2, vertex, vertex + n, sums, far)
    _loosen(vertex, 3, vertex, vertex + n + 1, sums, far)
    _loosen(vertex, 1, vertex - 1, vertex, sums, far)
    _loosen(vertex, 2, vertex - n, vertex, sums, far)
    _loosen(vertex, 3, vertex - n - 1, vertex, sums, far)
    at, factor = vertex * RECORD, far[2 * vertex]
    height, rival, votes = heights[vertex], rivals[2 * vertex], rivals[2 * vertex + 1]
    weight = sums[at + 5]
    atomic_add(sums, at, votes - (_ONE - factor) * weight)
    for k in range(4, RECORD):
        sums[at + k] *= factor
    sums[at + 4] += votes * rival
    sums[at + 5] += votes
    sums[at + 6] += votes * rival * rival
    heights[vertex] = rival
    rivals[2 * vertex] = height
    rivals[2 * vertex + 1] = max(weight - factor * votes, _ZERO)


@element
def _take_over(i, bands, layout, boxes, sums, heights, far, rivals, wins):
    first, n, top, bottom, level = rows_of(bands[i], layout)
    for row in range(top, bottom if wins[i] > 0 else top):
        for column in range(boxes[level, 2], boxes[level, 3]):
            vertex = first + row * n + column
            if far[2 * vertex] > _ZERO:
                _give_way(vertex, n, sums, heights, far, rivals)


@loop
def _take_over_all(count, bands, layout, boxes, sums, heights, far, rivals, wins):
    for parity in range(2):  # vertices reach into the rows of the next band
        for index in prange(count):
            i = np.int64(index)
            if bands[i] % 2 == parity:
                _take_over(i, bands, layout, boxes, sums, heights, far, rivals, wins)


@element
def _clear(i, bands, layout, boxes, far, wins):
    first, n, top, bottom, level = rows_of(bands[i], layout)
    for row in range(top, bottom if wins[i] > 0 else top):
        for column in range(boxes[level, 2], boxes[level, 3]):
            far[2 * (first + row * n + column)] = _ZERO


@loop
def _clear_all(count, bands, layout, boxes, far, wins):
    for i in prange(count):
        _clear(np.int64(i), bands, layout, boxes, far, wins)


vote = Kernel(_vote, _vote_all)
take_over = Kernel(_take_over, _take_over_all)
clear = Kernel(_clear, _clear_all)
