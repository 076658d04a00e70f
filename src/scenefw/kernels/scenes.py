"""Volumes of scenes of superquadrics, one voxel per element: distance, centre votes, labels."""

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop
from scenefw.kernels.superquadrics import is_inside, signed_distance

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_TINY = np.float32(1e-12)


@element
def _local(objects, scene, item, dx, dy, dz):  # noqa: ANN001, ANN202
    """An offset from the object's centre in its frame, moved to the octant x, y, z >= 0."""
    px = (
        objects[scene, item, 9] * dx + objects[scene, item, 12] * dy + objects[scene, item, 15] * dz
    )
    py = (
        objects[scene, item, 10] * dx
        + objects[scene, item, 13] * dy
        + objects[scene, item, 16] * dz
    )
    pz = (
        objects[scene, item, 11] * dx
        + objects[scene, item, 14] * dy
        + objects[scene, item, 17] * dz
    )
    return abs(px), abs(py), abs(pz)


@element
def _distance(objects, scene, item, px, py, pz, limit):  # noqa: ANN001, ANN202
    """Signed distance (m), or `limit` or more: what lies far from the box is not solved."""
    ax, ay, az = objects[scene, item, 0], objects[scene, item, 1], objects[scene, item, 2]
    ox, oy, oz = max(px - ax, _ZERO), max(py - ay, _ZERO), max(pz - az, _ZERO)
    outside = ox * ox + oy * oy + oz * oz
    if outside > _ZERO and (limit <= _ZERO or outside >= limit * limit):
        return max(limit, _ZERO)
    rx, ry, rz = objects[scene, item, 3], objects[scene, item, 4], objects[scene, item, 5]
    return signed_distance(px, py, pz, ax, ay, az, rx, ry, rz, limit)


@element
def _nearest(objects, scene, x, y, z, truncation):  # noqa: ANN001, ANN202
    """Signed distance of the nearest object, cut at `truncation`, and its label if inside."""
    best = truncation
    label = 0
    for item in range(objects.shape[1]):
        reach = objects[scene, item, 18]
        if reach > _ZERO:
            dx = x - objects[scene, item, 6]
            dy = y - objects[scene, item, 7]
            dz = z - objects[scene, item, 8]
            reach += max(best, _ZERO)
            if dx * dx + dy * dy + dz * dz < reach * reach:
                px, py, pz = _local(objects, scene, item, dx, dy, dz)
                distance = _distance(objects, scene, item, px, py, pz, best)
                if distance < best:
                    best = distance
                    if best < _ZERO:
                        label = item + 1
    return best, label


@element
def _fill(scene, cell, x, y, z, objects, grid, tsdf, votes, instances):  # noqa: ANN001, ANN202
    best, label = _nearest(objects, scene, x, y, z, grid[4])
    vx, vy, vz = _ZERO, _ZERO, _ZERO
    if label > 0:
        vx = objects[scene, label - 1, 6] - x
        vy = objects[scene, label - 1, 7] - y
        vz = objects[scene, label - 1, 8] - z
        length = max(math.sqrt(vx * vx + vy * vy + vz * vz), _TINY)
        vx, vy, vz = vx / length, vy / length, vz / length
    tsdf[scene, cell] = max(best, -grid[4])
    instances[scene, cell] = label
    votes[scene, 0, cell] = vx
    votes[scene, 1, cell] = vy
    votes[scene, 2, cell] = vz


@element
def _centre(index, axis, grid):  # noqa: ANN001, ANN202
    return grid[axis] + (np.float32(index) + _HALF) * grid[3]


@element
def _voxel(i, resolution, objects, grid, tsdf, votes, instances):  # noqa: ANN001, ANN202
    row, k = i // resolution, i % resolution
    column, j = row // resolution, row % resolution
    scene, n = column // resolution, column % resolution
    x, y, z = _centre(n, 0, grid), _centre(j, 1, grid), _centre(k, 2, grid)
    cell = (n * resolution + j) * resolution + k
    _fill(scene, cell, x, y, z, objects, grid, tsdf, votes, instances)


@element
def _reached(objects, scene, x, y, truncation):  # noqa: ANN001, ANN202
    """Whether any object may come within `truncation` of the vertical line through (x, y)."""
    for item in range(objects.shape[1]):
        reach = objects[scene, item, 18]
        if reach > _ZERO:
            dx = x - objects[scene, item, 6]
            dy = y - objects[scene, item, 7]
            reach += truncation
            if dx * dx + dy * dy < reach * reach:
                return True
    return False


@loop
def _voxels(count, resolution, objects, grid, tsdf, votes, instances):  # noqa: ANN001, ANN202
    # By rows along z: unravelling every index costs as much as the voxels that no object reaches.
    for index in prange(count // resolution):
        row = np.int64(index)
        column, j = row // resolution, row % resolution
        scene, n = column // resolution, column % resolution
        x, y = _centre(n, 0, grid), _centre(j, 1, grid)
        first = (n * resolution + j) * resolution
        if _reached(objects, scene, x, y, grid[4]):
            for k in range(resolution):
                z = _centre(k, 2, grid)
                _fill(scene, first + k, x, y, z, objects, grid, tsdf, votes, instances)
        else:
            tsdf[scene, first : first + resolution] = grid[4]
            votes[scene, :, first : first + resolution] = _ZERO
            instances[scene, first : first + resolution] = 0


scene_voxels = Kernel(
    _voxel,
    _voxels,
    types="i8, i8, f4[:, :, ::1], UniTuple(f4, 5), f4[:, ::1], f4[:, :, ::1], i4[:, ::1]",
)
"""Distances (B, C) m, votes (B, 3, C) and labels (B, C) of C = resolution^3 voxels.

Arguments: count = B C; resolution; objects (B, N, 19) float32: half-axes, exponents, position,
rotation by rows (object to world), bounding radius (0 = absent); grid, 5 float32: lowest corner,
voxel size, truncation; then the three outputs (float32, float32, int32).
"""


@element
def _contains(objects, scene, item, x, y, z):  # noqa: ANN001, ANN202
    dx = x - objects[scene, item, 6]
    dy = y - objects[scene, item, 7]
    dz = z - objects[scene, item, 8]
    reach = objects[scene, item, 18]
    if dx * dx + dy * dy + dz * dz >= reach * reach:
        return False
    px, py, pz = _local(objects, scene, item, dx, dy, dz)
    return is_inside(
        px / objects[scene, item, 0],
        py / objects[scene, item, 1],
        pz / objects[scene, item, 2],
        objects[scene, item, 3],
        objects[scene, item, 4],
        objects[scene, item, 5],
    )


@element
def _occupied(i, resolution, objects, grid, occupancy):  # noqa: ANN001, ANN202
    row, k = i // resolution, i % resolution
    column, j = row // resolution, row % resolution
    scene, n = column // resolution, column % resolution
    x, y, z = _centre(n, 0, grid), _centre(j, 1, grid), _centre(k, 2, grid)
    cell = (n * resolution + j) * resolution + k
    for item in range(objects.shape[1]):
        occupancy[scene, item, cell] = _contains(objects, scene, item, x, y, z)


@loop
def _occupied_all(count, resolution, objects, grid, occupancy):  # noqa: ANN001, ANN202
    for row in prange(count // resolution):  # along z, as above
        column, j = row // resolution, row % resolution
        scene, n = column // resolution, column % resolution
        x, y = _centre(n, 0, grid), _centre(j, 1, grid)
        first = (n * resolution + j) * resolution
        for item in range(objects.shape[1]):
            dx, dy = x - objects[scene, item, 6], y - objects[scene, item, 7]
            reach = objects[scene, item, 18]
            if dx * dx + dy * dy < reach * reach:
                for k in range(resolution):
                    inside = _contains(objects, scene, item, x, y, _centre(k, 2, grid))
                    occupancy[scene, item, first + k] = inside
            else:
                occupancy[scene, item, first : first + resolution] = False


object_voxels = Kernel(_occupied, _occupied_all)
"""Whether each of C voxels lies in each object, (B, N, C) bool; arguments as of `scene_voxels`."""
