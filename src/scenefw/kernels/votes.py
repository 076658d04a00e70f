"""Hough votes: rays marched through a finely subdivided grid, and mean shift of what they hit."""

import math

import numba
import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, atomic_add, element, loop

_FAR = numba.float32(1e30)

# Rays meet in the same cells, so on the CPU they take turns: a parallel loop would lose counts.
_serial = numba.njit(cache=True, error_model="numpy")


@element
def _count_traversals(i, starts, directions, bricks, subdivisions, counts):  # noqa: ANN001, ANN202
    """One ray by Amanatides and Woo (1987); bricks: < -1 outside, -1 uncounted, else a block."""
    x, y, z = starts[i, 0], starts[i, 1], starts[i, 2]
    dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
    middle = numba.float32(0.5) * subdivisions
    # Cells (ax, ay, az) inside voxel (x, y, z); a ray that starts on a cell's face enters forwards.
    before, after = int(math.ceil(middle)) - 1, int(math.floor(middle))  # noqa: RUF046 - on CUDA floats
    ax = before if dx < 0 else after
    ay = before if dy < 0 else after
    az = before if dz < 0 else after
    sx = 1 if dx > 0 else -1
    sy = 1 if dy > 0 else -1
    sz = 1 if dz > 0 else -1
    step_x = 1 / abs(dx) if dx != 0 else _FAR
    step_y = 1 / abs(dy) if dy != 0 else _FAR
    step_z = 1 / abs(dz) if dz != 0 else _FAR
    next_x = (ax + (1 if dx > 0 else 0) - middle) / dx if dx != 0 else _FAR
    next_y = (ay + (1 if dy > 0 else 0) - middle) / dy if dy != 0 else _FAR
    next_z = (az + (1 if dz > 0 else 0) - middle) / dz if dz != 0 else _FAR
    cells = subdivisions * subdivisions * subdivisions
    brick = bricks[x, y, z]
    while True:
        if brick >= 0:
            cell = (ax * subdivisions + ay) * subdivisions + az
            atomic_add(counts, brick * cells + cell, 1)
        is_new_voxel = False
        if next_x <= next_y and next_x <= next_z:
            next_x += step_x
            ax += sx
            if ax < 0 or ax >= subdivisions:
                x += sx
                ax -= sx * subdivisions
                is_new_voxel = True
        elif next_y <= next_z:
            next_y += step_y
            ay += sy
            if ay < 0 or ay >= subdivisions:
                y += sy
                ay -= sy * subdivisions
                is_new_voxel = True
        else:
            next_z += step_z
            az += sz
            if az < 0 or az >= subdivisions:
                z += sz
                az -= sz * subdivisions
                is_new_voxel = True
        if is_new_voxel:
            if min(x, y, z) < 0:
                return
            if x >= bricks.shape[0] or y >= bricks.shape[1] or z >= bricks.shape[2]:
                return
            brick = bricks[x, y, z]
            if brick < -1:
                return


@_serial
def _count_all(count, starts, directions, bricks, subdivisions, counts):  # noqa: ANN001, ANN202
    for i in range(count):
        _count_traversals(i, starts, directions, bricks, subdivisions, counts)


count_traversals = Kernel(_count_traversals, _count_all)
"""count_traversals(M, starts, directions, bricks, subdivisions, counts): adds one to each cell a
ray crosses.

starts (M, 3) int32 voxels, from whose centres the rays go; directions (M, 3) float32, unit;
bricks (X, Y, Z) int32: number of the voxel's block of subdivisions^3 cells in `counts` (flat
int32), -1 where rays pass uncounted, -2 where they end.
"""


@element
def _shift_to_mode(i, points, weights, bandwidth, steps, modes, densities):  # noqa: ANN001, ANN202
    """Gaussian mean shift of seed i, cut at three bandwidths (Cheng 1995)."""
    x, y, z = modes[i, 0], modes[i, 1], modes[i, 2]
    scale = numba.float32(-0.5) / (bandwidth * bandwidth)
    for _ in range(steps):
        total = numba.float32(0)
        mx, my, mz = total, total, total
        for j in range(points.shape[0]):
            ex, ey, ez = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
            exponent = scale * (ex * ex + ey * ey + ez * ez)
            if exponent > numba.float32(-4.5):
                weight = weights[j] * math.exp(exponent)
                total += weight
                mx += weight * ex
                my += weight * ey
                mz += weight * ez
        densities[i] = total
        if total == 0:
            return
        x += mx / total
        y += my / total
        z += mz / total
        modes[i, 0], modes[i, 1], modes[i, 2] = x, y, z
        squared_shift = (mx * mx + my * my + mz * mz) / (total * total)
        if squared_shift < numba.float32(1e-6) * bandwidth * bandwidth:
            return


@loop
def _shift_all(count, points, weights, bandwidth, steps, modes, densities):  # noqa: ANN001, ANN202
    for i in prange(count):
        _shift_to_mode(np.int64(i), points, weights, bandwidth, steps, modes, densities)


shift_to_modes = Kernel(_shift_to_mode, _shift_all)
"""shift_to_modes(S, points, weights, bandwidth, steps, modes, densities): moves seeds uphill, in
place.

points (P, 3) and weights (P,) float32; modes (S, 3) float32 hold the seeds; densities (S,) float32
becomes the kernel-weighted mass around each mode.
"""
