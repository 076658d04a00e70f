"""What depth images hold against a TSDF, and its derivative: one ray per pixel (thesis 5.3.3).

Positions are in voxels: 0 is the centre of the first voxel of an axis. The volume is flat, n^3
values in units of the truncation; `size` is (n, image width, image height), `box` is (voxel size,
lowest corner x, y, z) in metres, `sampling` is (step, margin, floor) in metres.
Each thread of a CPU adds to private grids (`slots` per view): no atomics, and sums in fixed order.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, atomic_add, element, loop
from scenefw.kernels.rays import direction, trilinear

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_ONE = np.float32(1)
_TINY = np.float32(1e-12)


@element
def _inside(n, x, y, z):
    top = np.float32(n - 1)
    return min(x, y, z) >= _ZERO and max(x, y, z) <= top


@element
def _add(slope, base, n, x, y, z, value):
    """Adds the derivative of an interpolated value to the eight voxels around it."""
    ix, iy, iz = min(int(x), n - 2), min(int(y), n - 2), min(int(z), n - 2)
    fx, fy, fz = x - np.float32(ix), y - np.float32(iy), z - np.float32(iz)
    gx, gy, gz = _ONE - fx, _ONE - fy, _ONE - fz
    a = base + (ix * n + iy) * n + iz
    b, c = a + n, a + n * n
    d = c + n
    atomic_add(slope, a, value * gx * gy * gz)
    atomic_add(slope, a + 1, value * gx * gy * fz)
    atomic_add(slope, b, value * gx * fy * gz)
    atomic_add(slope, b + 1, value * gx * fy * fz)
    atomic_add(slope, c, value * fx * gy * gz)
    atomic_add(slope, c + 1, value * fx * gy * fz)
    atomic_add(slope, d, value * fx * fy * gz)
    atomic_add(slope, d + 1, value * fx * fy * fz)


@element
def _enter(origin, slope, top, t_near, t_far):
    """The part of a ray between the outermost centres of one axis."""
    if abs(slope) < _TINY:
        return t_near, -_ONE if origin < _ZERO or origin > top else t_far
    first, second = -origin / slope, (top - origin) / slope
    return max(t_near, min(first, second)), min(t_far, max(first, second))


@element
def _cost_of(
    view, slot, u, v, volume, depth, intrinsics, poses, surface, empty, slopes, size, box, sampling
):
    pixel = (view * size[2] + v) * size[1] + u
    surface[pixel] = _ZERO
    empty[pixel] = _ZERO
    pixel_depth = depth[pixel]
    if pixel_depth <= _ZERO:
        return
    n = size[0]
    scale = _ONE / box[0]
    wx, wy, wz = direction(intrinsics, poses, view, u, v)
    ox = (poses[view, 0, 3] - box[1]) * scale - _HALF
    oy = (poses[view, 1, 3] - box[2]) * scale - _HALF
    oz = (poses[view, 2, 3] - box[3]) * scale - _HALF
    dx, dy, dz = wx * scale, wy * scale, wz * scale
    to_surface = 2 * slot * n * n * n
    to_empty = to_surface + n * n * n
    x, y, z = ox + pixel_depth * dx, oy + pixel_depth * dy, oz + pixel_depth * dz
    if poses[view, 2, 3] + pixel_depth * wz > sampling[2] and _inside(n, x, y, z):
        value = trilinear(volume, 0, n, x, y, z)
        surface[pixel] = abs(value)
        if value > _ZERO:
            _add(slopes, to_surface, n, x, y, z, _ONE)
        elif value < _ZERO:
            _add(slopes, to_surface, n, x, y, z, -_ONE)
    top = np.float32(n - 1)
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    t_near, t_far = _ZERO, pixel_depth - sampling[1] / length
    t_near, t_far = _enter(ox, dx, top, t_near, t_far)
    t_near, t_far = _enter(oy, dy, top, t_near, t_far)
    t_near, t_far = _enter(oz, dz, top, t_near, t_far)
    step = sampling[0] / length
    t = t_far
    total = _ZERO
    while t > t_near:
        x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
        if _inside(n, x, y, z):
            value = trilinear(volume, 0, n, x, y, z)
            if value < _ZERO:
                total -= value
                _add(slopes, to_empty, n, x, y, z, -_ONE)
        t -= step
    empty[pixel] = total


@element
def _cost(i, slots, volume, depth, intrinsics, poses, surface, empty, slopes, size, box, sampling):
    row, u = i // size[1], i % size[1]
    view, v = row // size[2], row % size[2]
    slot = view * slots + v * slots // size[2]
    _cost_of(
        view, slot, u, v, volume, depth, intrinsics, poses, surface, empty, slopes, size, box,
        sampling,
    )  # fmt: skip


@loop
def _cost_all(
    count, slots, volume, depth, intrinsics, poses, surface, empty, slopes, size, box, sampling
):
    _, width, height = size
    for index in prange(count // (width * height) * slots):
        slot = np.int64(index)
        view, part = slot // slots, slot % slots
        for v in range(-(-part * height // slots), -(-(part + 1) * height // slots)):
            for u in range(width):
                _cost_of(
                    view, slot, u, v, volume, depth, intrinsics, poses, surface, empty, slopes,
                    size, box, sampling,
                )  # fmt: skip


cost = Kernel(_cost, _cost_all)
