"""Soft light on surfaces, read off a distance field (Evans 2006; Quilez 2010): a point per element.

`box` is (voxel size, lowest corner x, y, z) in metres, `key` the direction to the light.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN201, ANN202

import numpy as np
import torch
from numba import prange
from torch import Tensor

from scenefw.core.types import GridSpec
from scenefw.kernels.compile import Kernel, element, float32, loop
from scenefw.kernels.rays import HALF, ONE, ZERO, trilinear

_OCCLUSION_STEPS = float32(0.008, 0.02, 0.045, 0.08)  # m along the normal
_SHADOW_STEPS = float32(*np.geomspace(0.012, 0.35, 9))  # m towards the light
_SHADOW_SOFTNESS = np.float32(9)
_LIFT = np.float32(0.004)  # m off the surface, where rays to the light start
_LEAST_OPEN = np.float32(0.35)
_OCCLUDED = np.float32(0.6 / 1.3)
_AMBIENT, _SKY, _KEY = float32(0.42, 0.22, 0.46)


@element
def _distance(field, n, box, x, y, z):
    return trilinear(
        field, 0, n, (x - box[1]) / box[0] - HALF, (y - box[2]) / box[0] - HALF,
        (z - box[3]) / box[0] - HALF,
    )  # fmt: skip


@element
def brightness(field, n, box, x, y, z, nx, ny, nz, key):
    """Of a point with its normal, see `brightness_of`."""
    blocked, share = ZERO, ONE
    for step in _OCCLUSION_STEPS:
        ahead = z + step * nz
        free = _distance(field, n, box, x + step * nx, y + step * ny, ahead)
        free = min(free, abs(ahead))  # the floor
        blocked += share * min(max(ONE - free / step, ZERO), ONE)
        share *= HALF
    is_open = min(max(ONE - _OCCLUDED * blocked, _LEAST_OPEN), ONE)
    lambert = min(max(nx * key[0] + ny * key[1] + nz * key[2], ZERO), ONE)
    lit = ONE
    if lambert > ZERO:
        x, y, z = x + _LIFT * nx, y + _LIFT * ny, z + _LIFT * nz
        for step in _SHADOW_STEPS:
            free = _distance(field, n, box, x + step * key[0], y + step * key[1], z + step * key[2])
            lit = min(lit, max(_SHADOW_SOFTNESS * free / step, ZERO))
    sky = HALF + HALF * nz
    return (_AMBIENT + _SKY * sky) * is_open + _KEY * lambert * lit


@element
def _light(i, field, n, box, points, normals, key, values):
    values[i] = brightness(
        field, n, box, points[i, 0], points[i, 1], points[i, 2],
        normals[i, 0], normals[i, 1], normals[i, 2], key,
    )  # fmt: skip


@loop
def _light_all(count, field, n, box, points, normals, key, values):
    for i in prange(count):
        _light(np.int64(i), field, n, box, points, normals, key, values)


_lit = Kernel(
    _light,
    _light_all,
    types="i8, f4[::1], i8, UniTuple(f4, 4), f4[:, ::1], f4[:, ::1], UniTuple(f4, 3), f4[::1]",
)


def brightness_of(
    field: Tensor, grid: GridSpec, points: Tensor, normals: Tensor, key: tuple[float, float, float]
) -> Tensor:
    """Brightness (N,) from a key light with shadow, the sky, and the occlusion of both.

    Args:
        field: (X, Y, Z) distances to objects (m); the floor z = 0 is added.
        grid: its voxels.
        points: (N, 3) on surfaces, world (m).
        normals: (N, 3) there.
        key: direction to the light, of length 1.
    """
    values = points.new_empty(len(points))
    box = float32(grid.voxel_size, *grid.lower)
    tensors = [tensor.float().contiguous() for tensor in (field.reshape(-1), points, normals)]
    _lit(len(points), tensors[0], grid.resolution, box, *tensors[1:], float32(*key), values)
    return values


def floor_map(
    field: Tensor, grid: GridSpec, reach: float, samples: int, key: tuple[float, float, float]
) -> Tensor:
    """Brightness of the floor (rows along y, columns along x) of the square |x|, |y| <= `reach`."""
    axis = torch.linspace(-reach, reach, samples, device=field.device)
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    cells = torch.stack([x, y, torch.zeros_like(x)], dim=-1).view(-1, 3)
    up = torch.tensor([0.0, 0.0, 1.0], device=field.device).expand(cells.shape)
    return brightness_of(field, grid, cells, up, key).view(samples, samples)
