"""Objects with pose and size from their meshes."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenefw.core import geometry
from scenefw.core.types import ObjectEstimate, PlacedShape, Pose, TriangleMesh

Array = NDArray[np.float64]

_NO_VOLUME = 1e-12  # m^3


def estimate_objects(
    meshes: Mapping[int, TriangleMesh],
    confidences: Mapping[int, float],
    placed: Mapping[int, PlacedShape] | None = None,
) -> tuple[ObjectEstimate, ...]:
    """One estimate per mesh in the order of their labels.

    Args:
        meshes: watertight, world coordinates, by instance label.
        confidences: in [0, 1], by label; 0 where missing.
        placed: the shapes of those objects that have one, by label.
    """
    return tuple(
        replace(
            _estimate(label, mesh, float(confidences.get(label, 0.0))),
            placed=(placed or {}).get(label),
        )
        for label, mesh in sorted(meshes.items())
    )


def principal_pose(mesh: TriangleMesh) -> Pose:
    """Centre of mass and principal axes of the solid inside a watertight mesh, longest axis first.

    Of the two directions of an axis the one whose largest component is positive is taken.
    """
    volume, centre, spread = moments(mesh)
    if abs(volume) < _NO_VOLUME:
        return Pose(centre, np.array([1.0, 0.0, 0.0, 0.0]))
    _, axes = np.linalg.eigh(spread)
    return Pose(centre, geometry.quaternion_from_rotation(_right_handed(axes[:, ::-1])))


def moments(mesh: TriangleMesh) -> tuple[float, Array, Array]:
    """Volume (m^3), centre of mass (3,) and covariance (3, 3) in m^2 of the solid inside a mesh.

    First and second moments are integrated over the tetrahedra between the faces and the middle of
    the vertices. A mesh without volume has its middle as the centre, and no covariance.
    """
    origin = mesh.vertices.mean(axis=0)
    corners = (mesh.vertices - origin)[mesh.faces]
    volumes = np.linalg.det(corners) / 6
    total = volumes.sum()
    if abs(total) < _NO_VOLUME:
        return float(total), origin, np.zeros((3, 3))
    sums = corners.sum(axis=1)
    centre = volumes @ sums / (4 * total)
    second = np.einsum("f,fki,fkj->ij", volumes, corners, corners)
    second = (second + np.einsum("f,fi,fj->ij", volumes, sums, sums)) / (20 * total)
    return float(total), centre + origin, second - np.outer(centre, centre)


def _estimate(label: int, mesh: TriangleMesh, confidence: float) -> ObjectEstimate:
    pose = principal_pose(mesh)
    local = (mesh.vertices - pose.position) @ pose.rotation
    return ObjectEstimate(label, mesh, pose, np.ptp(local, axis=0), confidence)


def _right_handed(axes: Array) -> Array:
    signs = np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(3)])
    axes = axes * np.where(signs == 0, 1.0, signs)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return axes
