"""Objects with pose and size from their meshes."""

from collections.abc import Mapping
from dataclasses import replace

from scenefw.core.geometry import bounds
from scenefw.core.types import ObjectEstimate, PlacedShape, Pose, TriangleMesh
from scenefw.shapes.moments import moments


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
    return moments(mesh).pose


def _estimate(label: int, mesh: TriangleMesh, confidence: float) -> ObjectEstimate:
    pose = principal_pose(mesh)
    local = (mesh.vertices - pose.position) @ pose.rotation
    low, high = bounds(local)
    return ObjectEstimate(label, mesh, pose, high - low, confidence)
