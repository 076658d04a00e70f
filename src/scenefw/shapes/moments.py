"""Volume, centre of mass and principal axes of the solid inside a watertight mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenefw.core import geometry
from scenefw.core.types import Float64, Pose, TriangleMesh
from scenefw.core.weak_cache import cached_by_identity

_NOTHING = 1e-12  # m^3


@dataclass(frozen=True, eq=False)
class Moments:
    """Of a solid of uniform density.

    Args:
        volume: m^3; negative where faces look inwards, about 0 where the mesh holds nothing.
        pose: centre of mass and principal axes in the mesh's frame, longest axis first.
        spread: (3,) mean squared distance from the centre along each of these axes (m^2).
    """

    volume: float
    pose: Pose
    spread: Float64

    @property
    def covariance(self) -> Float64:
        """(3, 3) of places in the solid, along the mesh's axes (m^2)."""
        axes = self.pose.rotation
        return np.asarray(axes * self.spread @ axes.T)


@cached_by_identity
def moments(mesh: TriangleMesh) -> Moments:
    """First and second moments, integrated over the tetrahedra between the faces and a point.

    Of the two directions of an axis the one whose largest component is positive is taken.
    """
    origin = mesh.vertices.mean(axis=0)
    corners = np.moveaxis((mesh.vertices - origin).take(mesh.faces, axis=0), 1, 0)
    volumes = np.einsum("ij,ij->i", corners[0], np.cross(corners[1], corners[2])) / 6
    total = float(volumes.sum())
    if abs(total) < _NOTHING:
        return Moments(total, Pose(origin, np.array([1.0, 0.0, 0.0, 0.0])), np.zeros(3))
    sums = corners[0] + corners[1] + corners[2]
    centre = volumes @ sums / (4 * total)
    second = sum((places.T * volumes) @ places for places in (*corners, sums)) / (20 * total)
    spread, axes = np.linalg.eigh(second - np.outer(centre, centre))
    rotation = geometry.quaternion_from_rotation(_right_handed(axes[:, ::-1]))
    return Moments(total, Pose(centre + origin, rotation), np.maximum(spread[::-1], 0))


def _right_handed(axes: Float64) -> Float64:
    signs = np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(3)])
    axes = axes * np.where(signs == 0, 1.0, signs)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return axes
