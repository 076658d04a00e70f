"""Objects with pose and size from their meshes."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenefw.core import geometry
from scenefw.core.types import ObjectEstimate, PlacedShape, Pose, TriangleMesh

Array = NDArray[np.float64]


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

    First and second moments are integrated over the tetrahedra between the faces and the origin.
    Of the two directions of an axis the one whose largest component is positive is taken.
    """
    origin = mesh.vertices.mean(axis=0)
    corners = (mesh.vertices - origin)[mesh.faces]
    volumes = np.linalg.det(corners) / 6
    total = volumes.sum()
    if abs(total) < 1e-12:
        return Pose(origin, np.array([1.0, 0.0, 0.0, 0.0]))
    sums = corners.sum(axis=1)
    centre = volumes @ sums / (4 * total)
    second = np.einsum("f,fki,fkj->ij", volumes, corners, corners)
    second = (second + np.einsum("f,fi,fj->ij", volumes, sums, sums)) / (20 * total)
    _, axes = np.linalg.eigh(second - np.outer(centre, centre))
    return Pose(centre + origin, geometry.quaternion_from_rotation(_right_handed(axes[:, ::-1])))


def _estimate(label: int, mesh: TriangleMesh, confidence: float) -> ObjectEstimate:
    pose = principal_pose(mesh)
    local = (mesh.vertices - pose.position) @ pose.rotation
    return ObjectEstimate(label, mesh, pose, np.ptp(local, axis=0), confidence)


def _right_handed(axes: Array) -> Array:
    signs = np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(3)])
    axes = axes * np.where(signs == 0, 1.0, signs)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return axes
