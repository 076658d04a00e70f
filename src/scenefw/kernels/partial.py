"""Partial TSDFs of depth images: per voxel by projection, per ray by inverse ray tracing.

Volumes are flat: B scenes of n^3 values one after the other; `size` is (n, image width, image
height), `box` is (voxel size, lowest corner x, y, z, truncation) in metres. Distances are along the
ray of the voxel or sample, positive in front. Constants are float32, as a double would widen
everything. Loops call the inner functions with rows and columns, as a 64-bit division costs a CPU
more than a sample.

Inverse ray tracing works in cells: cell c of an axis lies between the centres of voxels c - 1 and
c, so n + 1 cells cover what touches any voxel, and voxel c - 1 has number c in a grid padded by one
(cells are padded by one too).
Each thread of a CPU adds to private grids (`slots` per scene): no atomics, and sums in fixed order.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, atomic_add, atomic_min, element, loop
from scenefw.kernels.rays import direction

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_ONE = np.float32(1)
_NEAREST = np.float32(1e-3)  # metres before the camera; nothing closer is projected
_UNKNOWN = np.float32(-1e30)
NO_SAMPLE = np.float32(1e29)
_RIVALRY = np.float32(2)  # voxels: samples this much farther from their surface lose to the nearest
# Phases of neighbouring pixels' samples: the two-dimensional golden ratio fills [0, 1) evenly.
_PHASE_U = np.float32(0.7548777)
_PHASE_V = np.float32(0.5698403)


@element
def _camera(intrinsics, poses, scene, ix, iy, box):
    """Of a column of voxels: camera coordinates of the first, those of a step along z, intrinsics.

    Loaded ahead of the loop over the column, as compilers must not assume that its stores leave the
    camera's arrays alone.
    """
    voxel, lower_x, lower_y, lower_z, _ = box
    x = lower_x + (np.float32(ix) + _HALF) * voxel - poses[scene, 0, 3]
    y = lower_y + (np.float32(iy) + _HALF) * voxel - poses[scene, 1, 3]
    z = lower_z + _HALF * voxel - poses[scene, 2, 3]
    return (
        poses[scene, 0, 0] * x + poses[scene, 1, 0] * y + poses[scene, 2, 0] * z,
        poses[scene, 0, 1] * x + poses[scene, 1, 1] * y + poses[scene, 2, 1] * z,
        poses[scene, 0, 2] * x + poses[scene, 1, 2] * y + poses[scene, 2, 2] * z,
        poses[scene, 2, 0] * voxel,
        poses[scene, 2, 1] * voxel,
        poses[scene, 2, 2] * voxel,
        intrinsics[scene, 0],
        intrinsics[scene, 1],
        intrinsics[scene, 2] + _HALF,
        intrinsics[scene, 3] + _HALF,
    )


@element
def _look_up(depth, first_pixel, camera, iz, width, height):
    """Along-ray distance of a voxel centre to the surface at its nearest pixel, or _UNKNOWN."""
    x, y, z, step_x, step_y, step_z, fx, fy, cx, cy = camera
    at = np.float32(iz)
    ahead = z + at * step_z
    if ahead < _NEAREST:
        return _UNKNOWN
    inverse = _ONE / ahead
    a = (x + at * step_x) * inverse
    b = (y + at * step_y) * inverse
    u = fx * a + cx
    v = fy * b + cy
    if min(u, v) < _ZERO or u >= np.float32(width) or v >= np.float32(height):
        return _UNKNOWN
    surface = depth[first_pixel + int(v) * width + int(u)]
    if surface <= _ZERO:
        return _UNKNOWN
    return (surface - ahead) * math.sqrt(_ONE + a * a + b * b)


@element
def _project(i, depth, intrinsics, poses, distance, observed, size, box):
    n, width, height = size
    column = i // n
    scene = column // (n * n)
    camera = _camera(intrinsics, poses, scene, column // n % n, column % n, box)
    value = _look_up(depth, scene * width * height, camera, i % n, width, height)
    observed[i] = value > -box[0]
    distance[i] = min(value, box[4]) if value > -box[4] else box[4]


@loop
def _project_all(count, depth, intrinsics, poses, distance, observed, size, box):
    n, width, height = size
    for index in prange(count // n):
        column = np.int64(index)
        scene = column // (n * n)
        camera = _camera(intrinsics, poses, scene, column // n % n, column % n, box)
        for iz in range(n):
            value = _look_up(depth, scene * width * height, camera, iz, width, height)
            observed[column * n + iz] = value > -box[0]
            distance[column * n + iz] = min(value, box[4]) if value > -box[4] else box[4]


@element
def _surface(scene, u, v, depth, intrinsics, poses, size, box):
    """Where a pixel's ray meets the surface, in cells, and its unit direction."""
    _, width, height = size
    voxel, lower_x, lower_y, lower_z, _ = box
    wx, wy, wz = direction(intrinsics, poses, scene, u, v)
    z_depth = depth[(scene * height + v) * width + u]
    scale = _ONE / voxel
    x = (poses[scene, 0, 3] + z_depth * wx - lower_x) * scale + _HALF
    y = (poses[scene, 1, 3] + z_depth * wy - lower_y) * scale + _HALF
    z = (poses[scene, 2, 3] + z_depth * wz - lower_z) * scale + _HALF
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    return x, y, z, wx / length, wy / length, wz / length


@element
def _samples(u, v, sampling, box):
    """First sample of a ray (the one farthest behind), step and end, signed distances in voxels."""
    scale = _ONE / box[0]
    step, behind = sampling
    phase = np.float32(u) * _PHASE_U + np.float32(v) * _PHASE_V
    phase -= np.float32(int(phase))
    return (phase * step - behind) * scale, step * scale, box[4] * scale


@element
def _find_nearest_of(scene, slot, u, v, depth, intrinsics, poses, closest, size, box, sampling):
    """Lowers each cell's smallest |distance| by the samples of one ray."""
    if depth[(scene * size[2] + v) * size[1] + u] <= _ZERO:
        return
    x, y, z, dx, dy, dz = _surface(scene, u, v, depth, intrinsics, poses, size, box)
    distance, step, end = _samples(u, v, sampling, box)
    m = size[0] + 3
    top = np.float32(m - 2)
    base = slot * m * m * m
    while distance < end:
        px, py, pz = x - distance * dx, y - distance * dy, z - distance * dz
        if min(px, py, pz) >= _ZERO and max(px, py, pz) < top:
            cell = base + ((int(px) + 1) * m + int(py) + 1) * m + int(pz) + 1
            atomic_min(closest, cell, abs(distance))
        distance += step


@element
def _add(sums, at, far, limit, weight, value):
    if far <= limit:
        atomic_add(sums, at, weight * value)
        atomic_add(sums, at + 1, weight)


@element
def _spread_of(scene, slot, u, v, depth, intrinsics, poses, limit, sums, size, box, sampling):
    """Adds weights and weighted distances of the samples of one ray to the voxels around them."""
    if depth[(scene * size[2] + v) * size[1] + u] <= _ZERO:
        return
    x, y, z, dx, dy, dz = _surface(scene, u, v, depth, intrinsics, poses, size, box)
    distance, step, end = _samples(u, v, sampling, box)
    m = size[0] + 2
    top = np.float32(m - 1)
    to_limit, to_sums = scene * m * m * m, slot * m * m * m
    while distance < end:
        px, py, pz = x - distance * dx, y - distance * dy, z - distance * dz
        if min(px, py, pz) >= _ZERO and max(px, py, pz) < top:
            ix, iy, iz = int(px), int(py), int(pz)
            fx, fy, fz = px - np.float32(ix), py - np.float32(iy), pz - np.float32(iz)
            gx, gy, gz = _ONE - fx, _ONE - fy, _ONE - fz
            far = abs(distance)
            # A voxel farther along the ray than the sample is as much closer to the surface.
            value = distance + fx * dx + fy * dy + fz * dz
            a = (ix * m + iy) * m + iz
            b, c = a + m, a + m * m
            d = c + m
            p, q = to_limit, to_sums
            _add(sums, 2 * (q + a), far, limit[p + a], gx * gy * gz, value)
            _add(sums, 2 * (q + a + 1), far, limit[p + a + 1], gx * gy * fz, value - dz)
            _add(sums, 2 * (q + b), far, limit[p + b], gx * fy * gz, value - dy)
            _add(sums, 2 * (q + b + 1), far, limit[p + b + 1], gx * fy * fz, value - dy - dz)
            value -= dx
            _add(sums, 2 * (q + c), far, limit[p + c], fx * gy * gz, value)
            _add(sums, 2 * (q + c + 1), far, limit[p + c + 1], fx * gy * fz, value - dz)
            _add(sums, 2 * (q + d), far, limit[p + d], fx * fy * gz, value - dy)
            _add(sums, 2 * (q + d + 1), far, limit[p + d + 1], fx * fy * fz, value - dy - dz)
        distance += step


@element
def _find_nearest(i, slots, depth, intrinsics, poses, closest, size, box, sampling):
    row, u = i // size[1], i % size[1]
    scene, v = row // size[2], row % size[2]
    slot = scene * slots + v * slots // size[2]
    _find_nearest_of(scene, slot, u, v, depth, intrinsics, poses, closest, size, box, sampling)


@loop
def _find_nearest_all(count, slots, depth, intrinsics, poses, closest, size, box, sampling):
    _, width, height = size
    for index in prange(count // (width * height) * slots):
        slot = np.int64(index)
        scene, part = slot // slots, slot % slots
        for v in range(-(-part * height // slots), -(-(part + 1) * height // slots)):
            for u in range(width):
                _find_nearest_of(
                    scene, slot, u, v, depth, intrinsics, poses, closest, size, box, sampling
                )


@element
def _spread(i, slots, depth, intrinsics, poses, limit, sums, size, box, sampling):
    row, u = i // size[1], i % size[1]
    scene, v = row // size[2], row % size[2]
    slot = scene * slots + v * slots // size[2]
    _spread_of(scene, slot, u, v, depth, intrinsics, poses, limit, sums, size, box, sampling)


@loop
def _spread_all(count, slots, depth, intrinsics, poses, limit, sums, size, box, sampling):
    _, width, height = size
    for index in prange(count // (width * height) * slots):
        slot = np.int64(index)
        scene, part = slot // slots, slot % slots
        for v in range(-(-part * height // slots), -(-(part + 1) * height // slots)):
            for u in range(width):
                _spread_of(
                    scene, slot, u, v, depth, intrinsics, poses, limit, sums, size, box, sampling
                )


@element
def _limit_at(row, y, z, closest, limit, m):
    cells = m + 1
    a = (row // m * cells + row % m) * cells * cells + y * cells + z
    b = a + cells
    c = a + cells * cells
    d = c + cells
    best = min(
        min(min(closest[a], closest[a + 1]), min(closest[b], closest[b + 1])),
        min(min(closest[c], closest[c + 1]), min(closest[d], closest[d + 1])),
    )
    limit[(row * m + y) * m + z] = best + _RIVALRY


@element
def _limit(i, closest, limit, m):
    """Largest |distance| (voxels) of samples that count for voxel i of the padded grid."""
    _limit_at(i // (m * m), i // m % m, i % m, closest, limit, m)


@loop
def _limit_all(count, closest, limit, m):
    for row in prange(count // (m * m)):
        for y in range(m):
            for z in range(m):
                _limit_at(np.int64(row), y, z, closest, limit, m)


@element
def _normalise_at(scene, ix, iy, iz, slots, sums, distance, size, box):
    n = size[0]
    m = n + 2
    weighted, weight = _ZERO, _ZERO
    for slot in range(scene * slots, (scene + 1) * slots):
        at = 2 * (((slot * m + ix + 1) * m + iy + 1) * m + iz + 1)
        weighted += sums[at]
        weight += sums[at + 1]
    value = box[4]
    if weight > _ZERO:
        value = max(min(weighted / weight * box[0], value), -value)
    distance[((scene * n + ix) * n + iy) * n + iz] = value


@element
def _normalise(i, slots, sums, distance, size, box):
    """Divides the sum of weighted distances of voxel i by its weight; +truncation where none."""
    n = size[0]
    column = i // n
    _normalise_at(
        column // (n * n), column // n % n, column % n, i % n, slots, sums, distance, size, box
    )


@loop
def _normalise_all(count, slots, sums, distance, size, box):
    n = size[0]
    for index in prange(count // n):
        column = np.int64(index)
        scene, ix, iy = column // (n * n), column // n % n, column % n
        for iz in range(n):
            _normalise_at(scene, ix, iy, iz, slots, sums, distance, size, box)


_VIEWS = "f4[::1], f4[:, ::1], f4[:, :, ::1]"  # depth, intrinsics and poses
_GRID = "UniTuple(i8, 3), UniTuple(f4, 5)"

project = Kernel(
    _project,
    _project_all,
    types=f"i8, {_VIEWS}, f4[::1], b1[::1], {_GRID}",
)
find_nearest = Kernel(
    _find_nearest,
    _find_nearest_all,
    types=f"i8, i8, {_VIEWS}, f4[::1], {_GRID}, UniTuple(f4, 2)",
)
set_limits = Kernel(_limit, _limit_all, types="i8, f4[::1], f4[::1], i8")
spread = Kernel(
    _spread,
    _spread_all,
    types=f"i8, i8, {_VIEWS}, f4[::1], f4[::1], {_GRID}, UniTuple(f4, 2)",
)
normalise = Kernel(
    _normalise,
    _normalise_all,
    types=f"i8, i8, f4[::1], f4[::1], {_GRID}",
)
