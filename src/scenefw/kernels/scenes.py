"""Volumes of scenes of superquadrics, one voxel per element: distance, centre votes, labels."""

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop
from scenefw.kernels.superquadrics import signed_distance

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_TINY = np.float32(1e-12)


@element
def _local(objects, scene, item, x, y, z):  # noqa: ANN001, ANN202, PLR0913
    """The world point in the object's frame, moved to the octant of positive coordinates."""
    dx = x - objects[scene, item, 6]
    dy = y - objects[scene, item, 7]
    dz = z - objects[scene, item, 8]
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
def _distance(objects, scene, item, px, py, pz, limit):  # noqa: ANN001, ANN202, PLR0913
    """Signed distance (m) if it is below `limit`, else `limit` or more: far boxes are not solved."""
    ax, ay, az = objects[scene, item, 0], objects[scene, item, 1], objects[scene, item, 2]
    ox, oy, oz = max(px - ax, _ZERO), max(py - ay, _ZERO), max(pz - az, _ZERO)
    outside = ox * ox + oy * oy + oz * oz
    if outside > _ZERO and (limit <= _ZERO or outside >= limit * limit):
        return max(limit, _ZERO)
    rx, ry, rz = objects[scene, item, 3], objects[scene, item, 4], objects[scene, item, 5]
    return signed_distance(px, py, pz, ax, ay, az, rx, ry, rz)


@element
def _voxel(i, resolution, objects, grid, tsdf, votes, instances):  # noqa: ANN001, ANN202, PLR0913
    cells = resolution * resolution * resolution
    scene, cell = i // cells, i % cells
    x = grid[0] + (np.float32(cell // (resolution * resolution)) + _HALF) * grid[3]
    y = grid[1] + (np.float32(cell // resolution % resolution) + _HALF) * grid[3]
    z = grid[2] + (np.float32(cell % resolution) + _HALF) * grid[3]
    best = grid[4]
    label = 0
    for item in range(objects.shape[1]):
        reach = objects[scene, item, 18]
        if reach > _ZERO:
            dx = x - objects[scene, item, 6]
            dy = y - objects[scene, item, 7]
            dz = z - objects[scene, item, 8]
            reach += max(best, _ZERO)
            if dx * dx + dy * dy + dz * dz < reach * reach:
                px, py, pz = _local(objects, scene, item, x, y, z)
                distance = _distance(objects, scene, item, px, py, pz, best)
                if distance < best:
                    best = distance
                    if best < _ZERO:
                        label = item + 1
    tsdf[scene, cell] = max(best, -grid[4])
    instances[scene, cell] = label
    vx, vy, vz = _ZERO, _ZERO, _ZERO
    if label > 0:
        vx = objects[scene, label - 1, 6] - x
        vy = objects[scene, label - 1, 7] - y
        vz = objects[scene, label - 1, 8] - z
        length = max(math.sqrt(vx * vx + vy * vy + vz * vz), _TINY)
        vx, vy, vz = vx / length, vy / length, vz / length
    votes[scene, 0, cell] = vx
    votes[scene, 1, cell] = vy
    votes[scene, 2, cell] = vz


@loop
def _voxels(count, resolution, objects, grid, tsdf, votes, instances):  # noqa: ANN001, ANN202, PLR0913
    for i in prange(count):
        _voxel(i, resolution, objects, grid, tsdf, votes, instances)


scene_voxels = Kernel(_voxel, _voxels)
"""Distances (B, C) m, votes (B, 3, C) and labels (B, C) of C = resolution^3 voxels.

Arguments: count = B C; resolution; objects (B, N, 19) float32: half-axes, exponents, position,
rotation by rows (object to world), bounding radius (0 = absent); grid (5,) float32: lowest corner,
voxel size, truncation; then the three outputs (float32, float32, int32).
"""


@element
def _occupied(i, resolution, objects, grid, occupancy):  # noqa: ANN001, ANN202
    cells = resolution * resolution * resolution
    scene, cell = i // cells, i % cells
    x = grid[0] + (np.float32(cell // (resolution * resolution)) + _HALF) * grid[3]
    y = grid[1] + (np.float32(cell // resolution % resolution) + _HALF) * grid[3]
    z = grid[2] + (np.float32(cell % resolution) + _HALF) * grid[3]
    for item in range(objects.shape[1]):
        inside = False
        if objects[scene, item, 18] > _ZERO:
            px, py, pz = _local(objects, scene, item, x, y, z)
            ux, uy, uz = (
                px / objects[scene, item, 0],
                py / objects[scene, item, 1],
                pz / objects[scene, item, 2],
            )
            if max(ux, max(uy, uz)) < np.float32(1):
                inside = (
                    ux ** objects[scene, item, 3]
                    + uy ** objects[scene, item, 4]
                    + uz ** objects[scene, item, 5]
                ) < np.float32(1)
        occupancy[scene, item, cell] = inside


@loop
def _occupied_all(count, resolution, objects, grid, occupancy):  # noqa: ANN001, ANN202
    for i in prange(count):
        _occupied(i, resolution, objects, grid, occupancy)


object_voxels = Kernel(_occupied, _occupied_all)
"""Whether each of C voxels lies in each object: occupancy (B, N, C) bool; else as `scene_voxels`."""
