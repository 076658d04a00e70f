"""Volumes of scenes of meshes, from exact distances to their triangles (Open3D)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch, SceneVolumes
from scenefw.core.types import Float32, GridSpec, Int32, PlacedShape, SceneObject
from scenefw.kernels.meshes import Tree
from scenefw.representations.known_scenes import KnownScenes
from scenefw.representations.open3d_library import require_open3d


@dataclass(frozen=True, eq=False)
class SolidScenes:
    """B scenes of any closed meshes.

    Args:
        objects: of each scene.
        positions: (B, N, 3) float32 of their centres (m), on the device for the volumes; filled up
            with zeros.
    """

    objects: tuple[tuple[SceneObject, ...], ...]
    positions: Tensor

    @classmethod
    def of(
        cls, scenes: Sequence[tuple[SceneObject, ...]], device: torch.device | str | None = None
    ) -> SolidScenes:
        """Scenes whose volumes will be on a device."""
        positions = np.zeros((len(scenes), max(map(len, scenes), default=0), 3), np.float32)
        for row, items in zip(positions, scenes, strict=True):
            row[: len(items)] = [item.pose.position for item in items]
        return cls(tuple(scenes), torch.from_numpy(positions).to(device or "cpu"))


class ExactSolids(KnownScenes[SolidScenes]):
    """B scenes of any closed meshes."""

    def depth(self, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres by rays that meet the triangles; 0 = nothing hit."""
        trees = [
            Tree(_corners(objects), cameras.intrinsics.device)
            for objects in self.parameters.objects
        ]
        images = [tree.depth(cameras.of(row), table=False) for row, tree in enumerate(trees)]
        return torch.cat(images)

    def parameters_of(self, rows: Tensor) -> SolidScenes:
        """Parameters of some of the scenes, by their numbers (N,)."""
        objects = tuple(self.parameters.objects[row] for row in rows.tolist())
        return SolidScenes(objects, self.parameters.positions[rows])

    def computed(self) -> SceneVolumes:
        """Exact distances, votes and instances, as of `volumes.scene_volumes`."""
        scene_volumes = [_volumes(objects, self.grid) for objects in self.parameters.objects]
        tsdf, votes, instances = (np.stack(volumes) for volumes in zip(*scene_volumes, strict=True))
        device = self.parameters.positions.device
        return SceneVolumes(
            torch.from_numpy(tsdf)[:, None].to(device),
            torch.from_numpy(votes).to(device),
            torch.from_numpy(instances).to(device),
        )


def _corners(objects: Sequence[SceneObject]) -> Float32:
    """Triangles (F, 3, 3) of all objects, in the world (m)."""
    meshes = [PlacedShape(item.shape, item.pose).mesh() for item in objects]
    corners = [mesh.vertices[mesh.faces] for mesh in meshes]
    return np.concatenate([np.empty((0, 3, 3)), *corners]).astype(np.float32)


def _volumes(objects: Sequence[SceneObject], grid: GridSpec) -> tuple[Float32, Float32, Int32]:
    centres = grid.centres().astype(np.float32)
    nearest = np.full(grid.shape, grid.truncation, dtype=np.float32)
    owner = np.zeros(grid.shape, dtype=np.int32)
    for label, item in enumerate(objects, start=1):
        mesh = PlacedShape(item.shape, item.pose).mesh()
        box = _box(mesh.vertices, grid)
        if box is None:
            continue
        distances = signed_distances(mesh.vertices, mesh.faces, centres[box])
        closer = distances < nearest[box]
        nearest[box] = np.where(closer, distances, nearest[box])
        owner[box] = np.where(closer, label, owner[box])
    owner = np.where(nearest < 0, owner, 0).astype(np.int32)
    places = np.array([[0, 0, 0], *(item.pose.position for item in objects)], dtype=np.float32)
    votes = places[owner] - centres
    lengths = np.linalg.norm(votes, axis=-1, keepdims=True)
    votes = np.where(owner[..., None] > 0, votes / np.maximum(lengths, 1e-12), 0)
    tsdf = np.maximum(nearest, -grid.truncation)
    return tsdf, np.ascontiguousarray(np.moveaxis(votes, -1, 0), dtype=np.float32), owner


def _box(vertices: Any, grid: GridSpec) -> tuple[slice, ...] | None:
    """Voxels within the truncation of a mesh's bounding box; None if there is none."""
    reach = grid.truncation_voxels + 1
    low = np.floor(grid.to_voxels(vertices.min(axis=0)) - reach).astype(int)
    high = np.ceil(grid.to_voxels(vertices.max(axis=0)) + reach).astype(int) + 1
    low, high = np.clip(low, 0, grid.resolution), np.clip(high, 0, grid.resolution)
    if (low >= high).any():
        return None
    return tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))


def signed_distances(vertices: Any, faces: Any, points: Float32) -> Float32:
    """Distances (...) of points (..., 3) to a closed mesh (m), negative inside.

    Raises:
        MissingDependencyError: Open3D is not installed.
    """
    open3d = require_open3d("a volume of a mesh")
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        open3d.core.Tensor(np.asarray(vertices, np.float32)),
        open3d.core.Tensor(np.asarray(faces, np.uint32)),
    )
    queries = open3d.core.Tensor(np.ascontiguousarray(points, dtype=np.float32))
    distances: Float32 = scene.compute_signed_distance(queries, nsamples=3).numpy()
    return distances
