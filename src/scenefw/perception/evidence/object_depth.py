"""Where the rays of a camera enter and leave single objects, in every few pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.weak_cache import cached_by_identity
from scenefw.kernels.meshes import NOTHING
from scenefw.perception.evidence.mesh_distances import PAST_CROSSING, distances_to
from scenefw.perception.observation.pixels import coarse_step
from scenefw.perception.observation.points import rays as camera_rays

if TYPE_CHECKING:
    from scenefw.core.types import Camera, Float32, Float64, TriangleMesh

    Box = tuple[slice, slice]


@dataclass(frozen=True, eq=False)
class ObjectDepth:
    """Depth of an object by itself, along the camera's axis (m), in every `coarse_step`-th pixel.

    Args:
        box: rows and columns about its outline, in which (h, w) the others are.
        front: where rays enter it, 0 where they miss.
        back: where they leave it for the first time.
    """

    box: Box
    front: Float64
    back: Float64


def object_depth(mesh: TriangleMesh, camera: Camera) -> ObjectDepth:
    """The depth of a closed mesh, computed once for each camera."""
    depths = _depths(mesh)
    numbers = [camera.width, camera.height], camera.matrix.ravel(), camera.T_world_camera.ravel()
    key = np.concatenate(numbers).astype(np.float32).tobytes()  # kernels have them in float32
    if key not in depths:
        depths[key] = _object_depth(mesh, camera)
    return depths[key]


@cached_by_identity
def _depths(_mesh: TriangleMesh) -> dict[bytes, ObjectDepth]:
    return {}


def _object_depth(mesh: TriangleMesh, camera: Camera) -> ObjectDepth:
    step = coarse_step(camera.width)
    box = _box(mesh.vertices, camera, step)
    directions = camera_rays(camera, step)[box] @ camera.T_world_camera[:3, :3].T
    rays = np.zeros((directions[..., 0].size, 6), np.float32)
    rays[:, :3], rays[:, 3:] = camera.T_world_camera[:3, 3], directions.reshape(-1, 3)
    front = _cast(mesh, rays)
    hit = np.isfinite(front)
    inner = rays[hit]
    inner[:, :3] += (front[hit] + PAST_CROSSING)[:, None] * inner[:, 3:]
    depths = np.zeros((2, *directions.shape[:2]))
    depths[0].ravel()[hit] = front[hit]
    depths[1].ravel()[hit] = (
        front[hit] + PAST_CROSSING + np.nan_to_num(_cast(mesh, inner), posinf=0)
    )
    return ObjectDepth(box, *depths)


def _cast(mesh: TriangleMesh, rays: Float32) -> Float32:
    """How often its direction each ray (N, 6) goes to the mesh; infinity: it misses."""
    distance, hit, _ = distances_to(mesh).tree.cast(torch.from_numpy(rays), table=False)
    return np.where(hit.numpy() != NOTHING, distance.numpy(), np.float32(np.inf))


def _box(vertices: Float64, camera: Camera, step: int) -> Box:
    """Rows and columns, in steps, about the outline of vertices (N, 3)."""
    x, y, z = transform_points(inverse(camera.T_world_camera), vertices).T
    ahead = z > 0
    if not ahead.any():
        return slice(0, 0), slice(0, 0)
    x, y, z = x[ahead], y[ahead], z[ahead]
    return (
        _side(camera.fy * y / z + camera.cy, camera.height, step),
        _side(camera.fx * x / z + camera.cx, camera.width, step),
    )


def _side(pixels: Float64, size: int, step: int) -> slice:
    low, high = np.clip([pixels.min(), pixels.max()], -step, size - 1 + step) / step
    count = -(-size // step)
    return slice(min(max(int(np.floor(low)), 0), count), min(int(np.ceil(high)) + 1, count))
