"""How near the shape of one object is to the true one: surfaces seen and hidden, volume, size."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from scipy.spatial import cKDTree

from scenefw.core import rng as streams
from scenefw.core.geometry import inverse, transform_points
from scenefw.kernels.meshes import Tree
from scenefw.metrics.sampling import sample_surface
from scenefw.metrics.surface import Nearest, chamfer_of, f_score
from scenefw.perception.evidence.mesh_distances import MeshDistances
from scenefw.shapes.moments import moments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Camera, Float64, TriangleMesh

    Mask = NDArray[np.bool_]

F_DISTANCES = (0.005, 0.01)
"""Distances (m) of the F-scores."""

_POINTS = 2000  # on each surface: distances are to the other's triangles, so few are enough
_HIT = 0.001  # m: a ray ends on the surface that it was sent to


class ShapeScores(NamedTuple):
    """Of one object.

    Args:
        chamfer: mean distance of points on each surface to the other, mean of both directions (m).
        chamfer_visible: the same where the camera sees the true surface; predicted points count
            where the nearest true one does. NaN if nothing is visible.
        chamfer_hidden: where it doesn't.
        f_5, f_10: F-scores at 5 and 10 mm.
        iou: of the voxels that both fill.
        size_ratio: predicted volume by the true one.
    """

    chamfer: float
    chamfer_visible: float
    chamfer_hidden: float
    f_5: float
    f_10: float
    iou: float
    size_ratio: float


@dataclass(frozen=True, eq=False)
class SolidShape:
    """A closed surface with what comparisons ask of it, each computed once.

    Args:
        mesh: world coordinates (m).
        voxel: side of the voxels that it is compared in (m).
    """

    mesh: TriangleMesh
    voxel: float

    @cached_property
    def distances(self) -> MeshDistances:
        """To its triangles."""
        return MeshDistances(self.mesh)

    @cached_property
    def points(self) -> Float64:
        """(N, 3) on the surface, always the same (m)."""
        return sample_surface(self.mesh, _POINTS, streams.generator(0)).points

    @cached_property
    def volume(self) -> float:
        """m^3."""
        return abs(moments(self.mesh).volume)

    @cached_property
    def voxels(self) -> NDArray[np.int64]:
        """Sorted voxels (N,) whose middles lie inside, of a lattice that all shapes share."""
        low = np.floor(self.distances.low / self.voxel).astype(np.int64)
        high = np.ceil(self.distances.high / self.voxel).astype(np.int64)
        axes = [np.arange(a, b) for a, b in zip(low, high, strict=True)]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        inside = cells[self.distances.inside((cells + 0.5) * self.voxel)]
        return np.unique(_keys(inside))

    def iou(self, other: SolidShape) -> float:
        """Intersection over union of the voxels of two shapes."""
        shared = len(np.intersect1d(self.voxels, other.voxels, assume_unique=True))
        union = len(self.voxels) + len(other.voxels) - shared
        return shared / union if union else 0.0

    def distance(self, other: SolidShape, count: int = _POINTS) -> float:
        """Mean distance between surfaces, mean of both directions (m), from `count` points each."""
        step = -(-_POINTS // count)
        return 0.5 * float(
            np.abs(other.distances.at(self.points[::step])).mean()
            + np.abs(self.distances.at(other.points[::step])).mean()
        )


def shape_scores(predicted: SolidShape, true: SolidShape, is_visible: Mask) -> ShapeScores:
    """Scores of a shape.

    Args:
        predicted: as it is predicted.
        true: as it is.
        is_visible: (N,) which points of `true` the camera sees.
    """
    forward = np.abs(true.distances.at(predicted.points))
    backward = np.abs(predicted.distances.at(true.points))
    nearest = cKDTree(true.points).query(predicted.points)[1]
    neighbours = Nearest(forward, backward, nearest, np.zeros(0, np.int64))
    near, far = (f_score(neighbours, distance) for distance in F_DISTANCES)
    return ShapeScores(
        0.5 * chamfer_of(neighbours),
        _part(forward, backward, is_visible[nearest], is_visible),
        _part(forward, backward, ~is_visible[nearest], ~is_visible),
        near,
        far,
        predicted.iou(true),
        predicted.volume / true.volume,
    )


def visible_points(shape: SolidShape, visible: Mask, camera: Camera) -> Mask:
    """Which points (N,) of a shape a camera sees.

    Args:
        shape: world coordinates.
        visible: (H, W) pixels that show it, whatever may be in front.
        camera: with its pose.
    """
    local = transform_points(inverse(camera.T_world_camera), shape.points)
    z = np.maximum(local[:, 2], 1e-6)
    column = np.rint(camera.fx * local[:, 0] / z + camera.cx).astype(int)
    row = np.rint(camera.fy * local[:, 1] / z + camera.cy).astype(int)
    seen = (local[:, 2] > 0) & (column >= 0) & (column < camera.width)
    seen &= (row >= 0) & (row < camera.height)
    seen[seen] = visible[row[seen], column[seen]]
    eye = camera.T_world_camera[:3, 3]
    rays = np.column_stack([np.broadcast_to(eye, shape.points.shape), shape.points - eye])
    tree = Tree(shape.mesh.vertices[shape.mesh.faces].astype(np.float32))
    ratio = tree.cast(torch.from_numpy(rays.astype(np.float32)), table=False)[0].numpy()
    lengths = np.linalg.norm(rays[:, 3:], axis=1)
    return np.asarray(seen & ((1 - ratio) * lengths < _HIT))


def _part(forward: Float64, backward: Float64, of_forward: Mask, of_backward: Mask) -> float:
    """Mean of both directions over some points; of one where the other has none."""
    means = [
        float(distances[chosen].mean())
        for distances, chosen in ((forward, of_forward), (backward, of_backward))
        if chosen.any()
    ]
    return float(np.mean(means)) if means and of_backward.any() else float("nan")


def _keys(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """One number for each cell (N, 3), the same in all lattices."""
    shifted = cells + _HALF
    return np.asarray((shifted[:, 0] * 2 * _HALF + shifted[:, 1]) * 2 * _HALF + shifted[:, 2])


_HALF = 2**20  # cells on each side of the origin
