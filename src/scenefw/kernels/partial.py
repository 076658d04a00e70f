"""Partial TSDFs of depth images: per voxel by projection, per ray by inverse ray tracing.

Volumes are flat: B scenes of n^3 values one after the other. Constants are float32, as a double
would widen everything. Distances are along the ray of the voxel or sample, positive in front.
"""

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, atomic_add, atomic_min, element, loop
from scenefw.kernels.rays import direction

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_ONE = np.float32(1)
_NEAREST = np.float32(1e-3)  # metres before the camera; nothing closer is projected
NO_SAMPLE = np.float32(1e29)
_RIVALRY = np.float32(2)  # voxels: samples this much farther from their surface lose to the nearest
# Phases of neighbouring pixels' samples: the two-dimensional golden ratio fills [0, 1) evenly.
_PHASE_U = np.float32(0.7548777)
_PHASE_V = np.float32(0.5698403)


@element
def _look_up(depth, intrinsics, poses, scene, width, height, x, y, z):  # noqa: ANN001, ANN202
    """Along-ray distance of a world point to the surface at its nearest pixel, and whether any."""
    x -= poses[scene, 0, 3]
    y -= poses[scene, 1, 3]
    z -= poses[scene, 2, 3]
    ahead = poses[scene, 0, 2] * x + poses[scene, 1, 2] * y + poses[scene, 2, 2] * z
    if ahead < _NEAREST:
        return _ZERO, False
    a = (poses[scene, 0, 0] * x + poses[scene, 1, 0] * y + poses[scene, 2, 0] * z) / ahead
    b = (poses[scene, 0, 1] * x + poses[scene, 1, 1] * y + poses[scene, 2, 1] * z) / ahead
    u = intrinsics[scene, 0] * a + intrinsics[scene, 2] + _HALF
    v = intrinsics[scene, 1] * b + intrinsics[scene, 3] + _HALF
    if u < _ZERO or v < _ZERO or u >= np.float32(width) or v >= np.float32(height):
        return _ZERO, False
    surface = depth[(scene * height + int(v)) * width + int(u)]
    if surface <= _ZERO:
        return _ZERO, False
    return (surface - ahead) * math.sqrt(_ONE + a * a + b * b), True


@element
def _project(
    i, depth, intrinsics, poses, distance, observed, n, width, height,
    voxel, lower_x, lower_y, lower_z, truncation,
):  # fmt: skip  # noqa: ANN001, ANN202
    voxel = np.float32(voxel)
    truncation = np.float32(truncation)
    x = np.float32(lower_x) + (np.float32((i // (n * n)) % n) + _HALF) * voxel
    y = np.float32(lower_y) + (np.float32((i // n) % n) + _HALF) * voxel
    z = np.float32(lower_z) + (np.float32(i % n) + _HALF) * voxel
    value, measured = _look_up(depth, intrinsics, poses, i // (n * n * n), width, height, x, y, z)
    observed[i] = measured and value > -voxel
    distance[i] = min(value, truncation) if measured and value > -truncation else truncation


@loop
def _project_all(
    count, depth, intrinsics, poses, distance, observed, n, width, height,
    voxel, lower_x, lower_y, lower_z, truncation,
):  # fmt: skip  # noqa: ANN001, ANN202
    for column in prange(count // n):
        for i in range(column * n, (column + 1) * n):
            _project(
                i, depth, intrinsics, poses, distance, observed, n, width, height,
                voxel, lower_x, lower_y, lower_z, truncation,
            )  # fmt: skip


@element
def _pixel_ray(i, depth, intrinsics, poses, width, height, voxel, lower_x, lower_y, lower_z):  # noqa: ANN001, ANN202
    """Where a pixel's ray meets the surface and its unit direction, both in voxels.

    Voxel coordinates are those of cells of a grid padded by one voxel on each side.
    """
    pixels = width * height
    scene = i // pixels
    pixel = i % pixels
    wx, wy, wz = direction(intrinsics, poses, scene, pixel % width, pixel // width)
    scale = _ONE / np.float32(voxel)
    x = (poses[scene, 0, 3] + depth[i] * wx - np.float32(lower_x)) * scale + _HALF
    y = (poses[scene, 1, 3] + depth[i] * wy - np.float32(lower_y)) * scale + _HALF
    z = (poses[scene, 2, 3] + depth[i] * wz - np.float32(lower_z)) * scale + _HALF
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    return x, y, z, wx / length, wy / length, wz / length


@element
def _first_sample(i, width, height, step, behind):  # noqa: ANN001, ANN202
    """Signed distance (voxels) of a ray's sample farthest behind the surface."""
    pixel = i % (width * height)
    phase = np.float32(pixel % width) * _PHASE_U + np.float32(pixel // width) * _PHASE_V
    return (phase - np.float32(int(phase))) * step - behind


@element
def _slot(i, rays_per_scene, slots_per_scene):  # noqa: ANN001, ANN202
    """Number of the private grid that ray i adds to: the slot k with k R / S <= i < (k + 1) R / S."""
    return ((i + 1) * slots_per_scene - 1) // rays_per_scene


@element
def _find_nearest(
    i, depth, intrinsics, poses, closest, slots_per_scene, n, width, height,
    voxel, lower_x, lower_y, lower_z, truncation, step, behind,
):  # fmt: skip  # noqa: ANN001, ANN202
    """Lowers each cell's smallest |distance| by the samples of one ray."""
    if depth[i] <= _ZERO:
        return
    x, y, z, dx, dy, dz = _pixel_ray(
        i, depth, intrinsics, poses, width, height, voxel, lower_x, lower_y, lower_z
    )
    scale = _ONE / np.float32(voxel)
    step = np.float32(step) * scale
    end = np.float32(truncation) * scale
    distance = _first_sample(i, width, height, step, np.float32(behind) * scale)
    m = n + 1
    top = np.float32(m)
    base = _slot(i, width * height, slots_per_scene) * m * m * m
    while distance < end:
        px, py, pz = x - distance * dx, y - distance * dy, z - distance * dz
        if (
            px >= _ZERO and py >= _ZERO and pz >= _ZERO
            and px < top and py < top and pz < top
        ):  # fmt: skip
            cell = base + (int(px) * m + int(py)) * m + int(pz)
            atomic_min(closest, cell, abs(distance))
        distance += step


@element
def _spread(
    i, depth, intrinsics, poses, limit, sums, slots_per_scene, n, width, height,
    voxel, lower_x, lower_y, lower_z, truncation, step, behind,
):  # fmt: skip  # noqa: ANN001, ANN202
    """Adds weights and weighted distances of the samples of one ray to the voxels around them."""
    if depth[i] <= _ZERO:
        return
    x, y, z, dx, dy, dz = _pixel_ray(
        i, depth, intrinsics, poses, width, height, voxel, lower_x, lower_y, lower_z
    )
    scale = _ONE / np.float32(voxel)
    step = np.float32(step) * scale
    end = np.float32(truncation) * scale
    distance = _first_sample(i, width, height, step, np.float32(behind) * scale)
    m = n + 2
    top = np.float32(n + 1)
    scene_base = (i // (width * height)) * m * m * m
    slot_base = _slot(i, width * height, slots_per_scene) * m * m * m
    while distance < end:
        px, py, pz = x - distance * dx, y - distance * dy, z - distance * dz
        if (
            px >= _ZERO and py >= _ZERO and pz >= _ZERO
            and px < top and py < top and pz < top
        ):  # fmt: skip
            ix, iy, iz = int(px), int(py), int(pz)
            fx, fy, fz = px - np.float32(ix), py - np.float32(iy), pz - np.float32(iz)
            cell = (ix * m + iy) * m + iz
            # A voxel ahead of the sample along the ray is as much closer to the surface.
            at_cell = distance + fx * dx + fy * dy + fz * dz
            far = abs(distance)
            for corner in range(8):
                cx, cy, cz = corner >> 2, (corner >> 1) & 1, corner & 1
                voxel_index = cell + (cx * m + cy) * m + cz
                if far <= limit[scene_base + voxel_index]:
                    weight = (
                        (fx if cx else _ONE - fx)
                        * (fy if cy else _ONE - fy)
                        * (fz if cz else _ONE - fz)
                    )
                    value = at_cell
                    if cx:
                        value -= dx
                    if cy:
                        value -= dy
                    if cz:
                        value -= dz
                    at = 2 * (slot_base + voxel_index)
                    atomic_add(sums, at, weight * value)
                    atomic_add(sums, at + 1, weight)
        distance += step


@loop
def _find_nearest_all(
    count, depth, intrinsics, poses, closest, slots_per_scene, n, width, height,
    voxel, lower_x, lower_y, lower_z, truncation, step, behind,
):  # fmt: skip  # noqa: ANN001, ANN202
    slots = count // (width * height) * slots_per_scene
    for slot in prange(slots):  # no two threads share a slot, whatever their number
        for i in range(slot * count // slots, (slot + 1) * count // slots):
            _find_nearest(
                i, depth, intrinsics, poses, closest, slots_per_scene, n, width, height,
                voxel, lower_x, lower_y, lower_z, truncation, step, behind,
            )  # fmt: skip


@loop
def _spread_all(
    count, depth, intrinsics, poses, limit, sums, slots_per_scene, n, width, height,
    voxel, lower_x, lower_y, lower_z, truncation, step, behind,
):  # fmt: skip  # noqa: ANN001, ANN202
    slots = count // (width * height) * slots_per_scene
    for slot in prange(slots):  # no two threads share a slot, whatever their number
        for i in range(slot * count // slots, (slot + 1) * count // slots):
            _spread(
                i, depth, intrinsics, poses, limit, sums, slots_per_scene, n, width, height,
                voxel, lower_x, lower_y, lower_z, truncation, step, behind,
            )  # fmt: skip


@element
def _set_limit(i, closest, limit, n):  # noqa: ANN001, ANN202
    """Largest |distance| (voxels) of samples that count for voxel i of the padded grid."""
    m = n + 2
    cells = n + 1
    base = i // (m * m * m) * cells * cells * cells
    x, y, z = (i // (m * m)) % m, (i // m) % m, i % m
    best = NO_SAMPLE
    for ix in range(max(x - 1, 0), min(x + 1, cells)):
        for iy in range(max(y - 1, 0), min(y + 1, cells)):
            for iz in range(max(z - 1, 0), min(z + 1, cells)):
                best = min(best, closest[base + (ix * cells + iy) * cells + iz])
    limit[i] = best + _RIVALRY


@loop
def _set_limit_all(count, closest, limit, n):  # noqa: ANN001, ANN202
    for i in prange(count):
        _set_limit(i, closest, limit, n)


@element
def _finish(
    i, depth, intrinsics, poses, sums, distance, observed, slots_per_scene, n, width, height,
    voxel, lower_x, lower_y, lower_z, truncation,
):  # fmt: skip  # noqa: ANN001, ANN202
    """Normalises one voxel and looks up whether it was observed."""
    voxel = np.float32(voxel)
    truncation = np.float32(truncation)
    scene = i // (n * n * n)
    ix, iy, iz = (i // (n * n)) % n, (i // n) % n, i % n
    m = n + 2
    weighted, weight = _ZERO, _ZERO
    for slot in range(scene * slots_per_scene, (scene + 1) * slots_per_scene):
        at = 2 * (((slot * m + ix + 1) * m + iy + 1) * m + iz + 1)
        weighted += sums[at]
        weight += sums[at + 1]
    distance[i] = truncation
    if weight > _ZERO:
        distance[i] = max(min(weighted / weight * voxel, truncation), -truncation)
    value, measured = _look_up(
        depth, intrinsics, poses, scene, width, height,
        np.float32(lower_x) + (np.float32(ix) + _HALF) * voxel,
        np.float32(lower_y) + (np.float32(iy) + _HALF) * voxel,
        np.float32(lower_z) + (np.float32(iz) + _HALF) * voxel,
    )  # fmt: skip
    observed[i] = measured and value > -voxel


@loop
def _finish_all(
    count, depth, intrinsics, poses, sums, distance, observed, slots_per_scene, n, width, height,
    voxel, lower_x, lower_y, lower_z, truncation,
):  # fmt: skip  # noqa: ANN001, ANN202
    for column in prange(count // n):
        for i in range(column * n, (column + 1) * n):
            _finish(
                i, depth, intrinsics, poses, sums, distance, observed, slots_per_scene,
                n, width, height, voxel, lower_x, lower_y, lower_z, truncation,
            )  # fmt: skip


project = Kernel(_project, _project_all)
find_nearest = Kernel(_find_nearest, _find_nearest_all)
set_limit = Kernel(_set_limit, _set_limit_all)
spread = Kernel(_spread, _spread_all)
finish = Kernel(_finish, _finish_all)
