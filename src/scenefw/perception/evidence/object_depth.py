"""Where the rays of a camera enter and leave single objects, in every few pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.weak_cache import cached_by_identity
from scenefw.kernels.mesh_depth import draw
from scenefw.perception.observation.pixels import coarse_step

if TYPE_CHECKING:
    from scenefw.core.types import Camera, Float64, TriangleMesh

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
    vertices = transform_points(inverse(camera.T_world_camera), mesh.vertices)
    box = rows, columns = _box(vertices, camera, step)
    shape = rows.stop - rows.start, columns.stop - columns.start
    front, back = np.full((2, *shape), np.inf)
    focal, centre = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    first = np.array([rows.start, columns.start])
    # Copies are of one kind; code would be compiled for each, read-only ones among them
    triangles = np.array(vertices, order="C"), np.array(mesh.faces, order="C")
    draw(*triangles, focal, centre, step, first, front, back)
    front[np.isinf(front)] = back[np.isinf(back)] = 0.0
    return ObjectDepth(box, front, back)


def _box(vertices: Float64, camera: Camera, step: int) -> Box:
    """Rows and columns, in steps, about the outline of vertices (N, 3) in the camera's frame."""
    x, y, z = vertices.T
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
