"""Soft light for pictures, read off a distance field."""

import numpy as np
import torch
from scipy import ndimage
from torch.nn import functional

from scenefw.core.types import Float32, GridSpec
from scenefw.kernels import soft_light

_FLOOR_REACH = 0.8  # m
_FLOOR_SAMPLES = 160  # of 1 cm, a voxel of the finest usual grid


def floor_brightness(field: Float32, grid: GridSpec, points: Float32, key: Float32) -> Float32:
    """Brightness of floor points (N, 3), read off a map: it varies slowly and pixels are many."""
    volume = torch.from_numpy(np.ascontiguousarray(field))
    direction = (float(key[0]), float(key[1]), float(key[2]))
    light = soft_light.floor_map(volume, grid, _FLOOR_REACH, _FLOOR_SAMPLES, direction)
    where = torch.from_numpy(points[:, :2] / np.float32(_FLOOR_REACH))[None, :, None]
    found = functional.grid_sample(
        light[None, None], where, padding_mode="border", align_corners=True
    )
    return found.view(-1).numpy()


def brightness_of(
    field: Float32, grid: GridSpec, points: Float32, normals: Float32, key: Float32
) -> Float32:
    """Brightness (N,) of points (N, 3) with normals (N, 3), see `soft_light.brightness_of`."""
    volume, places, facing = (
        torch.from_numpy(np.ascontiguousarray(one)) for one in (field, points, normals)
    )
    direction = (float(key[0]), float(key[1]), float(key[2]))
    return soft_light.brightness_of(volume, grid, places, facing, direction).numpy()


def far_distance(tsdf: Float32, grid: GridSpec) -> Float32:
    """A TSDF continued beyond its truncation by a distance transform, objects alone."""
    far = tsdf > 0.9 * grid.truncation
    if far.all():
        return np.full(tsdf.shape, grid.extent, dtype=np.float32)
    beyond = ndimage.distance_transform_edt(far) * grid.voxel_size
    return np.where(far, 0.9 * grid.truncation + beyond, tsdf).astype(np.float32)


def sample(field: Float32, grid: GridSpec, points: Float32) -> Float32:
    """Trilinear values at world points (N, 3), the outermost ones beyond the cube."""
    centre = np.asarray(grid.lower, dtype=np.float32) + np.float32(grid.extent / 2)
    scaled = torch.from_numpy((points - centre)[:, ::-1] * np.float32(2 / grid.extent))
    volume = torch.from_numpy(np.ascontiguousarray(field))[None, None]
    values = functional.grid_sample(
        volume, scaled[None, :, None, None], padding_mode="border", align_corners=False
    )
    return values.view(-1).numpy()
