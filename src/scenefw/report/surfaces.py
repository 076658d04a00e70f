"""Surfaces of objects as triangles, for pictures that are sharper than voxels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.kernels.meshes import TABLE, Tree

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from scenefw.core.types import Camera, Float32, Float64, Int32, TriangleMesh

_SMOOTH = float(np.cos(np.radians(35)))  # faces that meet at less than this look round


class Surfaces:
    """Meshes that rays meet first.

    Args:
        meshes: in world coordinates (m), by label.
    """

    def __init__(self, meshes: Mapping[int, TriangleMesh]) -> None:
        corners = [mesh.vertices[mesh.faces] for mesh in meshes.values()]
        normals = [_corner_normals(mesh) for mesh in meshes.values()]
        labels = [np.full(len(mesh.faces), label) for label, mesh in meshes.items()]
        self._tree = Tree(np.concatenate([np.empty((0, 3, 3)), *corners]).astype(np.float32))
        order = self._tree.order
        self._normals = np.concatenate([np.empty((0, 3, 3)), *normals])[order].astype(np.float32)
        self._labels = np.concatenate([np.empty(0, int), *labels]).astype(np.int32)[order]

    def seen_from(self, camera: Camera) -> tuple[Float32, Float32, Int32]:
        """z-depth (H, W) in metres, normals (H, W, 3) and labels (H, W) of what pixels show.

        Depth 0 is nothing, label 0 the floor z = 0 or nothing. Normals of inner surfaces look at
        the camera.
        """
        rows, columns = np.indices((camera.height, camera.width), dtype=np.float32)
        depth, normals, labels = self.met(camera, columns.ravel(), rows.ravel())
        shape = rows.shape
        return depth.reshape(shape), normals.reshape(*shape, 3), labels.reshape(shape)

    def met(
        self, camera: Camera, columns: Float32, rows: Float32
    ) -> tuple[Float32, Float32, Int32]:
        """The same (N,), (N, 3), (N,) at places of the image (N,), which may lie between pixels."""
        rays = np.empty((len(columns), 6), np.float32)
        rays[:, :3] = camera.T_world_camera[:3, 3]
        rays[:, 3:] = directions(camera, columns, rows)
        depth, hit, place = (one.numpy() for one in self._tree.cast(torch.from_numpy(rays)))
        normals = np.zeros((len(rays), 3), np.float32)
        normals[hit == TABLE] = (0, 0, 1)
        labels = np.zeros(len(rays), np.int32)
        on = np.flatnonzero(hit >= 0)
        if len(on):
            faces, (b, c) = hit[on], place[on].T
            shares = np.stack([1 - b - c, b, c], axis=1)
            found = np.einsum("nk,nkj->nj", shares, self._normals[faces])
            found /= np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-9)
            away = np.einsum("nj,nj->n", found, rays[on, 3:]) > 0
            normals[on] = np.where(away[:, None], -found, found)
            labels[on] = self._labels[faces]
        return depth, normals, labels


def directions(camera: Camera, columns: Float32, rows: Float32) -> Float32:
    """Directions (N, 3) in the world through places of the image (N,), of length 1 in depth."""
    u, v = (columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy
    ahead = np.stack([u, v, np.ones_like(u)], axis=1).astype(np.float32)
    return ahead @ camera.T_world_camera[:3, :3].T.astype(np.float32)


def _corner_normals(mesh: TriangleMesh) -> Float64:
    """Normals (F, 3, 3) of the corners of faces, as means over faces that meet smoothly there."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.maximum(areas, 1e-15)
    first, second = _meeting(mesh.faces)
    smooth = np.einsum("nj,nj->n", normals[first // 3], normals[second // 3]) > _SMOOTH
    first, second = first[smooth], second[smooth]
    weighted = (areas * normals)[second // 3]
    sums = np.stack(
        [np.bincount(first, weighted[:, k], 3 * len(mesh.faces)) for k in range(3)], axis=1
    )
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    own = np.repeat(normals, 3, axis=0)
    found = np.where(lengths > 1e-15, sums / np.maximum(lengths, 1e-15), own)
    return np.asarray(found.reshape(-1, 3, 3))


def _meeting(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All pairs of corners, as 3 times the face plus 0 to 2, that lie on one vertex."""
    order = np.argsort(faces.ravel(), kind="stable")
    counts = np.bincount(faces.ravel())
    counts = counts[counts > 0]
    starts = np.cumsum(counts) - counts
    # Of each corner in order: the first and the number of the corners of its vertex
    start, count = np.repeat(starts, counts), np.repeat(counts, counts)
    first = np.repeat(order, count)
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return first, order[np.repeat(start, count) + within]
