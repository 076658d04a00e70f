"""Depth and silhouettes of objects given as meshes: one ray per pixel and object."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import Camera, Float32, Float64, TriangleMesh
from scenefw.kernels.meshes import Tree
from scenefw_annotated_views.annotations import Box, Silhouette

_NEAR = 0.01  # m: what reaches nearer may be seen anywhere


class SolidViews:
    """A scene of closed meshes on the floor z = 0, to look at from any side.

    Args:
        meshes: in world coordinates (m).
    """

    def __init__(self, meshes: Sequence[TriangleMesh]) -> None:
        self._points = [mesh.vertices for mesh in meshes]
        self._trees = [Tree(mesh.vertices[mesh.faces].astype(np.float32)) for mesh in meshes]

    def see(self, camera: Camera) -> tuple[Float32, list[Silhouette]]:
        """z-depth (H, W) in metres with the floor, 0 = nothing, and the silhouette of each object.

        An object is visible in a pixel if its ray meets it before the others and the floor.
        """
        depth = _floor(camera)
        owner = np.full(depth.shape, -1)
        casts = []
        for number, (points, tree) in enumerate(zip(self._points, self._trees, strict=True)):
            window = _window(points, camera)
            object_depth = _cast(tree, camera, window)
            casts.append((window, object_depth))
            inside, part = _inside(window, object_depth, camera)
            nearer = (part > 0) & (part <= depth[inside])
            depth[inside][nearer], owner[inside][nearer] = part[nearer], number
        depth[~np.isfinite(depth)] = 0
        silhouettes = [
            _silhouette(window, object_depth, owner == number, camera)
            for number, (window, object_depth) in enumerate(casts)
        ]
        return depth, silhouettes


def _floor(camera: Camera) -> Float32:
    """z-depth (H, W) of the plane z = 0, infinite above the horizon."""
    directions = _directions(camera, (0, 0, camera.width - 1, camera.height - 1))
    down = -directions[..., 2]
    depth = np.full(down.shape, np.inf, np.float32)
    np.divide(camera.T_world_camera[2, 3], down, out=depth, where=down > 0, casting="same_kind")
    return depth


def _directions(camera: Camera, window: Box) -> Float64:
    """Directions (h, w, 3) of pixels in the world; each is 1 long along the camera's axis."""
    left, top, right, bottom = window
    v, u = np.mgrid[top : bottom + 1, left : right + 1]
    ahead = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)])
    turned: Float64 = np.moveaxis(ahead, 0, -1) @ camera.T_world_camera[:3, :3].T
    return turned


def _window(points: Float64, camera: Camera) -> Box:
    """Pixels that the projection of a mesh may cover, of the image and as much around it."""
    width, height = camera.width, camera.height
    x, y, z = transform_points(inverse(camera.T_world_camera), points).T
    if z.max() < _NEAR:
        return (0, 0, -1, -1)
    if z.min() < _NEAR:
        return (-width, -height, 2 * width - 1, 2 * height - 1)
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    return (
        max(int(np.floor(u.min())), -width),
        max(int(np.floor(v.min())), -height),
        min(int(np.ceil(u.max())), 2 * width - 1),
        min(int(np.ceil(v.max())), 2 * height - 1),
    )


def _cast(tree: Tree, camera: Camera, window: Box) -> Float32:
    """z-depth of a mesh alone in a window of pixels, 0 = not met."""
    left, top, right, bottom = window
    shape = (max(bottom - top + 1, 0), max(right - left + 1, 0))
    if not shape[0] * shape[1]:
        return np.zeros(shape, np.float32)
    ahead = _directions(camera, window).reshape(-1, 3)
    eye = np.broadcast_to(camera.T_world_camera[:3, 3], ahead.shape)
    rays = torch.from_numpy(np.concatenate([eye, ahead], axis=1).astype(np.float32))
    distance, _, _ = tree.cast(rays, table=False)
    return distance.numpy().reshape(shape)


def _inside(window: Box, values: NDArray, camera: Camera) -> tuple[tuple[slice, slice], NDArray]:
    """Cuts a window of pixels to the image, beyond which it may reach.

    Returns:
        Rows and columns of the image that the window covers, and the values of these pixels.
    """
    left, top, right, bottom = window
    rows = slice(min(max(top, 0), camera.height), max(min(bottom + 1, camera.height), 0))
    columns = slice(min(max(left, 0), camera.width), max(min(right + 1, camera.width), 0))
    if rows.stop <= rows.start or columns.stop <= columns.start:
        return (slice(0, 0), slice(0, 0)), values[:0, :0]
    part = values[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
    return (rows, columns), part


def _silhouette(
    window: Box, object_depth: Float32, visible: NDArray[np.bool_], camera: Camera
) -> Silhouette:
    covered = object_depth > 0
    mask = np.zeros((camera.height, camera.width), bool)
    inside, part = _inside(window, covered, camera)
    mask[inside] = part
    rows, columns = np.nonzero(covered)
    box = None
    if len(rows):
        left, top = window[:2]
        box = (
            int(columns.min()) + left,
            int(rows.min()) + top,
            int(columns.max()) + left,
            int(rows.max()) + top,
        )
    return Silhouette(mask, visible, int(covered.sum()), box)
