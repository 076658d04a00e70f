"""The surfaces of a scene's objects, to cast rays at."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import ArrayLike

from scenefw.core.types import Float64, Int32, PlacedShape, SceneObject, TriangleMesh
from scenefw.kernels.meshes import Tree

_SKIN = 1e-3  # m: a ray to a point of the surface ends this far before it


class Surfaces:
    """Triangles of all objects, each with its object's label.

    Args:
        objects: by label.
    """

    def __init__(self, objects: Mapping[int, SceneObject]) -> None:
        self.meshes: dict[int, TriangleMesh] = {
            label: PlacedShape(item.shape, item.pose).mesh() for label, item in objects.items()
        }
        corners = [mesh.vertices[mesh.faces] for mesh in self.meshes.values()]
        labels = [np.full(len(m.faces), label) for label, m in self.meshes.items()]
        self._tree = Tree(np.concatenate([np.zeros((0, 3, 3)), *corners]).astype(np.float32))
        self._labels = np.concatenate([np.zeros(0, np.int32), *labels])[self._tree.order]

    def cast(self, origins: ArrayLike, directions: ArrayLike) -> tuple[Float64, Int32]:
        """Distances (R,), infinite where nothing is hit, and labels (R,), there 0.

        Args:
            origins: (R, 3) m.
            directions: (R, 3) or (3,), of unit length.
        """
        starts = np.asarray(origins, dtype=np.float64)
        rays = np.concatenate([starts, np.broadcast_to(directions, starts.shape)], axis=1)
        intersections = self._tree.cast(torch.from_numpy(np.float32(rays)), table=False)
        distance, hit = intersections[0].double().numpy(), intersections[1].numpy()
        if not len(self._labels):
            return np.full(len(starts), np.inf), np.zeros(len(starts), np.int32)
        labels = np.where(hit >= 0, self._labels[np.maximum(hit, 0)], 0).astype(np.int32)
        return np.where(hit >= 0, distance, np.inf), labels

    def is_visible(self, points: Float64, normals: Float64, eye: Float64) -> np.ndarray:
        """Which surface points (N, 3) face a position and have nothing in between, (N,) bool."""
        rays = points - eye
        distance = np.linalg.norm(rays, axis=1)
        directions = rays / distance[:, None]
        facing = (directions * normals).sum(axis=1) < 0
        hit, _ = self.cast(np.broadcast_to(eye, points.shape), directions)
        return np.asarray(facing & (hit > distance - _SKIN))
