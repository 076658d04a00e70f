"""Log-probabilities of classes at the vertices of a height map: by triangles or by projection.

A vertex holds C sums of log-likelihoods one after the other, all 0 where nothing was said. What a
pixel says is its distribution mixed with the uniform one, so that no class is ever ruled out.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, atomic_add, element, loop
from scenefw.kernels.elementary import exp, log
from scenefw.kernels.triangles import SEEN, corners, level_of, parents

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_EIGHTH = np.float32(0.125)
_ONE = np.float32(1)
_GRAZING = np.float32(1e-6)
_NEAREST = np.float32(1e-3)  # metres before the camera; nothing closer is projected


@element
def _say(logits, vertex, weight, far, labels, pixel, pixels, classes, decay, floor):
    """Adds a pixel's log-likelihoods (eqs 4.7-4.10) to a vertex at distance `far` in cells.

    With a and b of eq. 4.9 the expectation (4.10) over the pixel's distribution m is
    e m(v) + (1 - e) / C with e = exp(-decay far).
    """
    if not weight > _ZERO:
        return
    confidence = exp(-decay * far)
    share = (_ONE - np.float32(classes) * floor) * confidence
    uniform_share = (_ONE - share) / np.float32(classes)
    for c in range(classes):
        value = log(share * labels[c * pixels + pixel] + uniform_share)
        atomic_add(logits, vertex * classes + c, weight * value)


@element
def _by_angle(cosine, power):
    """cosine^power, 1 without computing it where the power is 0."""
    return exp(power * log(max(cosine, _GRAZING))) if power > _ZERO else _ONE


@element
def _add_pixel(pixel, n, cells, spots, labels, logits, pixels, classes, settings):
    decay, floor, power = settings
    cell, f, g = cells[pixel], spots[pixel, 0], spots[pixel, 1]
    middle, a, b, c = corners(cell, f, g, n)
    weight = _by_angle(spots[pixel, 3], power)
    p, q = _ONE - f, _ONE - g
    to_first, to_last = math.sqrt(f * f + g * g), math.sqrt(p * p + q * q)
    to_middle = math.sqrt(f * f + q * q) if middle == cell + 1 else math.sqrt(p * p + g * g)
    _say(logits, cell, weight * a, to_first, labels, pixel, pixels, classes, decay, floor)
    _say(logits, middle, weight * b, to_middle, labels, pixel, pixels, classes, decay, floor)
    _say(logits, cell + n + 1, weight * c, to_last, labels, pixel, pixels, classes, decay, floor)


@element
def _add(i, bands, order, starts, work, layout, cells, spots, labels, logits, size, settings):
    if bands[i] >= 0:
        n = layout[level_of(bands[i], layout), 1]
        _add_pixel(i, n, cells, spots, labels, logits, size[0], size[1], settings)


@loop
def _add_all(
    count, bands, order, starts, work, layout, cells, spots, labels, logits, size, settings
):
    pixels, classes = size
    for parity in range(2):
        for k in prange(work[parity, 0]):
            band = work[parity, np.int64(k) + 1]
            n = layout[level_of(band, layout), 1]
            for j in range(starts[band], starts[band + 1]):
                _add_pixel(order[j], n, cells, spots, labels, logits, pixels, classes, settings)


@element
def _merge_at(row, column, logits, coarse, merged, level, classes):
    """A vertex's own log-likelihoods and its share of those of the coarser levels."""
    first, n, below = level
    at = (row * n + column) * classes
    p, q = 0, 0
    if below > 0:
        p, q = parents(row, column, below)
    for c in range(classes):
        value = logits[first * classes + at + c]
        if below > 0:  # a coarse vertex stands for four: what it was told is divided among them
            value += _EIGHTH * (coarse[p * classes + c] + coarse[q * classes + c])
        merged[at + c] = value


@element
def _merge(i, logits, coarse, merged, level, classes):
    _merge_at(i // level[1], i % level[1], logits, coarse, merged, level, classes)


@loop
def _merge_all(count, logits, coarse, merged, level, classes):
    for row in prange(level[1]):
        for column in range(level[1]):
            _merge_at(np.int64(row), column, logits, coarse, merged, level, classes)


@element
def _normalise(i, logits, probabilities, vertices, classes):
    """Probabilities (C, vertices) of a vertex's log-likelihoods."""
    maximum = logits[i * classes]
    for c in range(1, classes):
        maximum = max(maximum, logits[i * classes + c])
    total = _ZERO
    for c in range(classes):
        total += exp(logits[i * classes + c] - maximum)
    for c in range(classes):
        probabilities[c * vertices + i] = exp(logits[i * classes + c] - maximum) / total


@loop
def _normalise_all(count, logits, probabilities, vertices, classes):
    for i in prange(count):
        _normalise(np.int64(i), logits, probabilities, vertices, classes)


@element
def _look_at(row, column, heights, depth, labels, intrinsics, poses, logits, size, box, settings):
    """Adds to a vertex the distribution between the four pixels around its projection."""
    n, width, height, classes = size
    lower_x, upper_y, spacing = box
    floor, tolerance, power = settings
    vertex = row * n + column
    high = heights[vertex]
    if high > SEEN:
        return
    x = lower_x + np.float32(column) * spacing - poses[0, 0, 3]
    y = upper_y - np.float32(row) * spacing - poses[0, 1, 3]
    z = high - poses[0, 2, 3]
    ahead = poses[0, 0, 2] * x + poses[0, 1, 2] * y + poses[0, 2, 2] * z
    if not ahead > _NEAREST:
        return
    right = poses[0, 0, 0] * x + poses[0, 1, 0] * y + poses[0, 2, 0] * z
    down = poses[0, 0, 1] * x + poses[0, 1, 1] * y + poses[0, 2, 1] * z
    u = intrinsics[0, 0] * right / ahead + intrinsics[0, 2]
    v = intrinsics[0, 1] * down / ahead + intrinsics[0, 3]
    if not (
        u >= _ZERO and v >= _ZERO and u <= np.float32(width - 1) and v <= np.float32(height - 1)
    ):
        return
    iu, iv = max(min(int(u), width - 2), 0), max(min(int(v), height - 2), 0)
    right_of, below = min(1, width - 1), min(1, height - 1) * width  # of a single pixel: itself
    nearest = int(v + _HALF) * width + int(u + _HALF)
    if not (depth[nearest] > _ZERO and abs(depth[nearest] - ahead) <= tolerance):
        return
    weight = _by_angle(abs(z) / math.sqrt(x * x + y * y + z * z), power)
    s, t = u - np.float32(iu), v - np.float32(iv)
    a, b, c, d = (_ONE - s) * (_ONE - t), s * (_ONE - t), (_ONE - s) * t, s * t
    share = _ONE - np.float32(classes) * floor
    for k in range(classes):
        at = (k * height + iv) * width + iu
        value = a * labels[at] + b * labels[at + right_of]
        value += c * labels[at + below] + d * labels[at + below + right_of]
        logits[vertex * classes + k] += weight * log(share * value + floor)


@element
def _look(i, heights, depth, labels, intrinsics, poses, logits, size, part, box, settings):
    top, left, columns = part
    _look_at(
        top + i // columns, left + i % columns,
        heights, depth, labels, intrinsics, poses, logits, size, box, settings,
    )  # fmt: skip


@loop
def _look_all(count, heights, depth, labels, intrinsics, poses, logits, size, part, box, settings):
    top, left, columns = part
    for row in prange(top, top + count // columns):
        for column in range(left, left + columns):
            _look_at(
                np.int64(row),
                column,
                heights,
                depth,
                labels,
                intrinsics,
                poses,
                logits,
                size,
                box,
                settings,
            )


add = Kernel(_add, _add_all)
merge = Kernel(_merge, _merge_all)
normalise = Kernel(_normalise, _normalise_all)
look = Kernel(_look, _look_all)
