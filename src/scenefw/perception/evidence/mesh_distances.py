"""Distances to closed meshes, without an optional library."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.constants import golden

from scenefw.core.geometry import bounds, within
from scenefw.core.weak_cache import cached_by_identity
from scenefw.kernels.meshes import NOTHING, Tree

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Float64, GridSpec, Int32, TriangleMesh

_PAST_CROSSING = np.finfo(np.float32).resolution
"""From a crossing of a ray to where it goes on (m): more than what float32 rounds."""
_RAY_OFFSET = _PAST_CROSSING / np.array([golden, np.e])
"""m: rays through edges of axis-aligned meshes would count twice."""


class MeshDistances:
    """Signed distances to a closed mesh, and its height over places of the floor.

    Args:
        mesh: closed, world coordinates (m).
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.vertices, self.faces = mesh.vertices, mesh.faces
        self.low, self.high = bounds(mesh.vertices)

    def inside(self, points: Float64) -> NDArray[np.bool_]:
        """Whether points (N, 3) lie in the solid: rays upwards cross the surface an odd number."""
        points = np.asarray(points, dtype=np.float64)
        inside = np.zeros(len(points), dtype=bool)
        rows = np.flatnonzero(within(points, self.low, self.high))
        start = (points[rows] + (*_RAY_OFFSET, 0.0)).astype(np.float32)
        odd_mask = np.zeros(len(rows), dtype=bool)
        active_rays = np.arange(len(rows))
        for _ in self.faces:  # a ray crosses each once at most
            if not len(active_rays):
                break
            distance, hit = self._cast(start[active_rays], 1.0)
            active_rays, distance = active_rays[hit], distance[hit]
            odd_mask[active_rays] ^= True
            start[active_rays, 2] += distance + _PAST_CROSSING
        inside[rows] = odd_mask
        return inside

    def at(self, points: Float64, limit: float = np.inf) -> Float64:
        """Distances (N,) of points (N, 3) to the surface (m), negative inside.

        Those beyond `limit` are cut there.
        """
        points = np.asarray(points, dtype=np.float64)
        places = torch.from_numpy(points.astype(np.float32))
        distances = self.tree.distances(places, limit).numpy().astype(np.float64)
        return np.where(self.inside(points), -distances, distances)

    def lowest(self, places: Float64) -> Float64:
        """Height (N,) of the lowest surface over places (N, 2) of the floor; NaN where is none."""
        return self._height(places, self.low[2] - 1.0, 1.0)

    def highest(self, places: Float64) -> Float64:
        """Height (N,) of the highest surface over places (N, 2) of the floor; NaN where is none."""
        return self._height(places, self.high[2] + 1.0, -1.0)

    def _height(self, places: Float64, start: float, up: float) -> Float64:
        points = np.column_stack([places + _RAY_OFFSET, np.full(len(places), start)])
        distance, hit = self._cast(points.astype(np.float32), up)
        return np.where(hit, start + up * distance.astype(np.float64), np.nan)

    def _cast(self, start: Float32, up: float) -> tuple[Float32, NDArray[np.bool_]]:
        rays = np.zeros((len(start), 6), dtype=np.float32)
        rays[:, :3], rays[:, 5] = start, up
        distance, hit, _ = self.tree.cast(torch.from_numpy(rays), table=False)
        return distance.numpy(), hit.numpy() != NOTHING

    @cached_property
    def tree(self) -> Tree:
        """Its triangles, for rays."""
        return Tree(self.vertices[self.faces].astype(np.float32))


distances_to = cached_by_identity(MeshDistances)
"""The distances to a closed mesh, made once per mesh."""


def mesh_volumes(
    meshes: Sequence[tuple[int, TriangleMesh]], grid: GridSpec
) -> tuple[Float32, Int32]:
    """Signed distances (X, Y, Z) to the nearest of several solids (m), and labels (X, Y, Z).

    Distances are cut at the grid's truncation. A voxel is of the object in which it lies deepest.

    Args:
        meshes: label and closed mesh of each, world coordinates (m).
        grid: the voxel grid.
    """
    nearest = np.full(grid.shape, grid.truncation, dtype=np.float32)
    owner = np.zeros(grid.shape, dtype=np.int32)
    centres = grid.centres()
    for label, mesh in meshes:
        distances = distances_to(mesh)
        low = np.floor(grid.to_voxels(distances.low - grid.truncation)).astype(int)
        high = np.ceil(grid.to_voxels(distances.high + grid.truncation)).astype(int) + 1
        low, high = (np.clip(corner, 0, grid.resolution) for corner in (low, high))
        box = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
        shape = nearest[box].shape
        if not all(shape):
            continue
        part = distances.at(centres[box].reshape(-1, 3), grid.truncation).reshape(shape)
        part = np.clip(part, -grid.truncation, grid.truncation).astype(np.float32)
        closer = part < nearest[box]
        nearest[box] = np.where(closer, part, nearest[box])
        owner[box] = np.where(closer, label, owner[box])
    return nearest, np.where(nearest < 0, owner, 0).astype(np.int32)
