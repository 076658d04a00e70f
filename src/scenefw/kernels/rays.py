"""Rays through a TSDF grid: sphere tracing (Hart 1996), one ray per pixel, float32 throughout.

Positions are in voxels: 0 is the centre of the first voxel of an axis. Volumes are flat and hold B
scenes of n^3 values one after the other. `size` is (n, image width, image height), `box` is (voxel
size, lowest corner x, y, z) in metres. Constants are float32, as a double would widen everything.
Loops call the per-pixel functions with row and column, as a 64-bit division costs a CPU more than a
step of a ray. Rays march inside `bounds` alone (scene, lowest or highest, axis; in voxels), outside
which no value is negative.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN201, ANN202

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop

ZERO = np.float32(0)
HALF = np.float32(0.5)
ONE = np.float32(1)
_NEVER = np.float32(1e30)
_TINY = np.float32(1e-12)
_FAR = np.float32(2)  # voxels: beyond, one look at the nearest voxel replaces interpolation
_HALF_DIAGONAL = np.float32(0.867)  # of a voxel: the error of that look, at most
_SHORTEST_STEP = np.float32(0.25)  # voxels: grazing rays would creep otherwise
_REFINEMENTS = 8
_LANES = 64  # groups of interleaved rows, so that threads share costly and cheap rows evenly

NOTHING, FLOOR, OBJECT = 0, 1, 2


@element
def trilinear(volume, base, n, x, y, z):
    """Value between voxel centres; outside them, that of the nearest border point."""
    top = np.float32(n - 1)
    x = min(max(x, ZERO), top)
    y = min(max(y, ZERO), top)
    z = min(max(z, ZERO), top)
    ix = min(int(x), n - 2)
    iy = min(int(y), n - 2)
    iz = min(int(z), n - 2)
    fx = x - np.float32(ix)
    fy = y - np.float32(iy)
    fz = z - np.float32(iz)
    a = base + (ix * n + iy) * n + iz
    b = a + n
    c = a + n * n
    d = c + n
    a0 = volume[a] + fz * (volume[a + 1] - volume[a])
    b0 = volume[b] + fz * (volume[b + 1] - volume[b])
    c0 = volume[c] + fz * (volume[c + 1] - volume[c])
    d0 = volume[d] + fz * (volume[d + 1] - volume[d])
    ab = a0 + fy * (b0 - a0)
    cd = c0 + fy * (d0 - c0)
    return ab + fx * (cd - ab)


@element
def nearest(volume, base, n, x, y, z):
    """Value of the nearest voxel."""
    top = np.float32(n - 1)
    ix = int(min(max(x, ZERO), top) + HALF)
    iy = int(min(max(y, ZERO), top) + HALF)
    iz = int(min(max(z, ZERO), top) + HALF)
    return volume[base + (ix * n + iy) * n + iz]


@element
def direction(intrinsics, poses, scene, u, v):
    """World direction of a pixel's ray, scaled to advance by 1 along the optical axis."""
    a = (np.float32(u) - intrinsics[scene, 2]) / intrinsics[scene, 0]
    b = (np.float32(v) - intrinsics[scene, 3]) / intrinsics[scene, 1]
    x = poses[scene, 0, 0] * a + poses[scene, 0, 1] * b + poses[scene, 0, 2]
    y = poses[scene, 1, 0] * a + poses[scene, 1, 1] * b + poses[scene, 1, 2]
    z = poses[scene, 2, 0] * a + poses[scene, 2, 1] * b + poses[scene, 2, 2]
    return x, y, z


@element
def _clip(origin, slope, low, high, enter, leave):
    """Narrows the part of a ray between two planes along one axis."""
    if abs(slope) < _TINY:
        return enter, -ONE if origin < low or origin > high else leave
    inverse = ONE / slope
    first = (low - origin) * inverse
    second = (high - origin) * inverse
    return max(enter, min(first, second)), min(leave, max(first, second))


@element
def _root(volume, base, n, scale, tolerance, start, slope, t_near, above, t_far, below):
    """Zero of the interpolated value between `t_near` (positive) and `t_far` (Illinois method)."""
    ox, oy, oz = start
    dx, dy, dz = slope
    middle = t_far
    side = 0
    for _ in range(_REFINEMENTS):
        middle = t_near + (t_far - t_near) * above / (above - below)
        value = scale * trilinear(
            volume, base, n, ox + middle * dx, oy + middle * dy, oz + middle * dz
        )
        if abs(value) < tolerance:
            break
        if value > ZERO:
            t_near, above = middle, value
            if side == 1:
                below *= HALF
            side = 1
        else:
            t_far, below = middle, value
            if side == 2:
                above *= HALF
            side = 2
    return middle


@element
def _march(volume, base, n, scale, tolerance, start, slope, t, leave, max_steps):
    """Distance (voxels) to the first zero along a ray between `t` and `leave`, or -1."""
    ox, oy, oz = start
    dx, dy, dz = slope
    last, above = t, -ONE
    for _ in range(max_steps):
        x, y, z = ox + t * dx, oy + t * dy, oz + t * dz
        value = scale * nearest(volume, base, n, x, y, z)
        if value > _FAR:
            step = value - _HALF_DIAGONAL
        else:
            value = scale * trilinear(volume, base, n, x, y, z)
            if value <= ZERO:
                if above < ZERO:  # inside from the start: an object cut by the cube
                    return t
                return _root(volume, base, n, scale, tolerance, start, slope, last, above, t, value)
            step = max(value, _SHORTEST_STEP)
        if t >= leave:
            break
        last, above = t, value
        t = min(t + step, leave)
    return -ONE


@element
def _trace_pixel(
    scene,
    u,
    v,
    volume,
    bounds,
    intrinsics,
    poses,
    depth,
    kind,
    size,
    box,
    tolerance,
    max_steps,
    floor,
):
    n, width, height = size
    voxel, lower_x, lower_y, lower_z = box
    scale = ONE / voxel
    wx, wy, wz = direction(intrinsics, poses, scene, u, v)
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    slope = (wx / length, wy / length, wz / length)
    height_above = poses[scene, 2, 3]
    start = (
        (poses[scene, 0, 3] - lower_x) * scale - HALF,
        (poses[scene, 1, 3] - lower_y) * scale - HALF,
        (height_above - lower_z) * scale - HALF,
    )
    enter, leave = ZERO, _NEVER
    for axis in range(3):
        low, high = bounds[scene, 0, axis], bounds[scene, 1, axis]
        enter, leave = _clip(start[axis], slope[axis], low, high, enter, leave)
    ground = _NEVER
    if floor and abs(wz) > _TINY and height_above * wz < ZERO:
        ground = -height_above / wz
        leave = min(leave, ground * length * scale)
    hit = -ONE
    if enter < leave and bounds[scene, 0, 0] < bounds[scene, 1, 0]:
        base = scene * n * n * n
        hit = _march(
            volume, base, n, scale, tolerance * scale, start, slope, enter, leave, max_steps
        )
    i = (scene * height + v) * width + u
    if hit >= ZERO:
        depth[i] = hit * voxel / length
        kind[i] = OBJECT
    elif ground < _NEVER:
        depth[i] = ground
        kind[i] = FLOOR
    else:
        depth[i] = ZERO
        kind[i] = NOTHING


@element
def _trace(
    i, volume, bounds, intrinsics, poses, depth, kind, size, box, tolerance, max_steps, floor
):
    row, u = i // size[1], i % size[1]
    _trace_pixel(
        row // size[2], u, row % size[2],
        volume, bounds, intrinsics, poses, depth, kind, size, box, tolerance, max_steps, floor,
    )  # fmt: skip


@loop
def _trace_all(
    count, volume, bounds, intrinsics, poses, depth, kind, size, box, tolerance, max_steps, floor
):
    _, width, height = size
    for lane in prange(_LANES):
        for row in range(np.int64(lane), count // width, _LANES):
            for u in range(width):
                _trace_pixel(
                    row // height, u, row % height, volume, bounds, intrinsics, poses,
                    depth, kind, size, box, tolerance, max_steps, floor,
                )  # fmt: skip


@element
def _instance(instances, base, n, x, y, z):
    """Label of the nearest labelled voxel among the 4^3 around a point, or 0."""
    best, label = _NEVER, 0
    cx, cy, cz = int(x + ONE) - 1, int(y + ONE) - 1, int(z + ONE) - 1
    for ix in range(max(cx - 1, 0), min(cx + 3, n)):
        for iy in range(max(cy - 1, 0), min(cy + 3, n)):
            for iz in range(max(cz - 1, 0), min(cz + 3, n)):
                voxel_label = instances[base + (ix * n + iy) * n + iz]
                if voxel_label > 0:
                    dx, dy, dz = x - np.float32(ix), y - np.float32(iy), z - np.float32(iz)
                    distance = dx * dx + dy * dy + dz * dz
                    if distance < best:
                        best, label = distance, voxel_label
    return label


@element
def _shade_pixel(
    scene, u, v, volume, labels, intrinsics, poses, depth, kind, normals, instances, size, box
):
    n, width, height = size
    voxel, lower_x, lower_y, lower_z = box
    i = (scene * height + v) * width + u
    nx, ny, nz = ZERO, ZERO, ZERO
    label = -1
    if kind[i] == FLOOR:
        nz = ONE
        label = 0
    elif kind[i] == OBJECT:
        scale = ONE / voxel
        base = scene * n * n * n
        wx, wy, wz = direction(intrinsics, poses, scene, u, v)
        x = (poses[scene, 0, 3] + depth[i] * wx - lower_x) * scale - HALF
        y = (poses[scene, 1, 3] + depth[i] * wy - lower_y) * scale - HALF
        z = (poses[scene, 2, 3] + depth[i] * wz - lower_z) * scale - HALF
        nx = trilinear(volume, base, n, x + HALF, y, z) - trilinear(volume, base, n, x - HALF, y, z)
        ny = trilinear(volume, base, n, x, y + HALF, z) - trilinear(volume, base, n, x, y - HALF, z)
        nz = trilinear(volume, base, n, x, y, z + HALF) - trilinear(volume, base, n, x, y, z - HALF)
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        if length < _TINY:  # where an object is cut by the cube the field may be flat
            nx, ny, nz = -wx, -wy, -wz
            length = math.sqrt(wx * wx + wy * wy + wz * wz)
        nx, ny, nz = nx / length, ny / length, nz / length
        label = _instance(labels, base, n, x, y, z)
    normals[scene, 0, v, u] = nx
    normals[scene, 1, v, u] = ny
    normals[scene, 2, v, u] = nz
    instances[i] = label


@element
def _shade(i, volume, labels, intrinsics, poses, depth, kind, normals, instances, size, box):
    row, u = i // size[1], i % size[1]
    _shade_pixel(
        row // size[2], u, row % size[2],
        volume, labels, intrinsics, poses, depth, kind, normals, instances, size, box,
    )  # fmt: skip


@loop
def _shade_all(
    count, volume, labels, intrinsics, poses, depth, kind, normals, instances, size, box
):
    _, width, height = size
    for lane in prange(_LANES):
        for row in range(np.int64(lane), count // width, _LANES):
            for u in range(width):
                _shade_pixel(
                    row // height, u, row % height,
                    volume, labels, intrinsics, poses, depth, kind, normals, instances, size, box,
                )  # fmt: skip


trace = Kernel(_trace, _trace_all)
shade = Kernel(_shade, _shade_all)
