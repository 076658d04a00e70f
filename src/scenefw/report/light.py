"""Soft light for pictures, read off a distance field (Evans 2006; Quilez 2010)."""

import numpy as np
import torch
from scipy import ndimage
from torch.nn import functional

from scenefw.core.types import Float32, GridSpec

_FLOOR_REACH = 0.8  # m
_FLOOR_SAMPLES = 224
_OCCLUSION_STEPS = (0.008, 0.02, 0.045, 0.08)  # m along the normal
_SHADOW_STEPS = tuple(np.geomspace(0.012, 0.35, 9).tolist())  # m towards the light
_SHADOW_SOFTNESS = 9.0


def floor_brightness(field: Float32, grid: GridSpec, points: Float32, key: Float32) -> Float32:
    """Brightness of floor points (N, 3), read off a map: it varies slowly and pixels are many."""
    axis = np.linspace(-_FLOOR_REACH, _FLOOR_REACH, _FLOOR_SAMPLES, dtype=np.float32)
    x, y = np.meshgrid(axis, axis)
    cells = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    up = np.broadcast_to(np.array([0, 0, 1], dtype=np.float32), cells.shape)
    light = brightness_of(field, grid, cells, up, key).reshape(1, 1, len(axis), len(axis))
    where = torch.from_numpy(points[:, :2] / np.float32(_FLOOR_REACH))[None, :, None]
    found = functional.grid_sample(
        torch.from_numpy(light), where, padding_mode="border", align_corners=True
    )
    return found.view(-1).numpy()


def brightness_of(
    field: Float32, grid: GridSpec, points: Float32, normals: Float32, key: Float32
) -> Float32:
    """Brightness (N,) from a key light with shadow, the sky, and the occlusion of both."""
    lambert = np.clip(normals @ key, 0, 1)
    shadow = _shadow(field, grid, points + np.float32(0.004) * normals, key)
    sky = 0.5 + 0.5 * normals[:, 2]
    ambient = (0.42 + 0.22 * sky) * _occlusion(field, grid, points, normals)
    return (ambient + 0.46 * lambert * shadow).astype(np.float32)


def far_distance(tsdf: Float32, grid: GridSpec) -> Float32:
    """A TSDF continued beyond its truncation by a distance transform, objects alone."""
    far = tsdf > 0.9 * grid.truncation
    if far.all():
        return np.full(tsdf.shape, grid.extent, dtype=np.float32)
    beyond = ndimage.distance_transform_edt(far) * grid.voxel_size
    return np.where(far, 0.9 * grid.truncation + beyond, tsdf).astype(np.float32)


def _occlusion(field: Float32, grid: GridSpec, points: Float32, normals: Float32) -> Float32:
    blocked = np.zeros(len(points), dtype=np.float32)
    for i, step in enumerate(_OCCLUSION_STEPS):
        ahead = points + step * normals
        free = np.minimum(sample(field, grid, ahead), np.abs(ahead[:, 2]))
        blocked += 0.5**i * np.clip(1 - free / step, 0, 1)
    return np.clip(1 - 0.6 * blocked / 1.3, 0.35, 1)


def _shadow(field: Float32, grid: GridSpec, points: Float32, key: Float32) -> Float32:
    lit = np.ones(len(points), dtype=np.float32)
    for step in _SHADOW_STEPS:
        free = sample(field, grid, points + step * key)
        lit = np.minimum(lit, np.clip(_SHADOW_SOFTNESS * free / step, 0, 1))
    return lit


def sample(field: Float32, grid: GridSpec, points: Float32) -> Float32:
    """Trilinear values at world points (N, 3), the outermost ones beyond the cube."""
    centre = np.asarray(grid.lower, dtype=np.float32) + np.float32(grid.extent / 2)
    scaled = torch.from_numpy((points - centre)[:, ::-1] * np.float32(2 / grid.extent))
    volume = torch.from_numpy(np.ascontiguousarray(field))[None, None]
    values = functional.grid_sample(
        volume, scaled[None, :, None, None], padding_mode="border", align_corners=False
    )
    return values.view(-1).numpy()
