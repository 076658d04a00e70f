"""Predicted scenes as what pictures are drawn from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from scenefw.report.shading import Solid
from scenefw.report.surfaces import Surfaces
from scenefw.shapes.vessel import Vessel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Float32, Pose, SceneEstimate
    from scenefw.report.palette import Colour


def solid_of(
    estimate: SceneEstimate, colours: Sequence[Colour], seen: Float32 | None = None
) -> Solid:
    """A predicted scene with the surfaces of its objects, and shadows as of its volume.

    Args:
        estimate: the scene.
        colours: red, green, blue in [0, 1] by label.
        seen: (X, Y, Z) in [0, 1]; surfaces are pale where it is 0. None = nowhere.
    """
    surfaces = Surfaces({item.id: item.mesh for item in estimate.objects})
    field, vessels = of_objects(estimate), _vessels(estimate)
    hollow = field.copy()
    for label, (shape, pose) in vessels.items():
        box = _about(estimate, label)
        local = (estimate.grid.centres()[box] - pose.position) @ pose.rotation
        filled = shape.filled_distance(local)
        others = np.where(estimate.instances[box] == label, np.inf, estimate.tsdf[box])
        open_ = np.minimum(shape.wall_distance(local), others)
        hollow[box] = np.where(filled < 0, open_, hollow[box])
        field[box] = np.minimum(field[box], filled)
    return Solid(
        field, estimate.instances, estimate.grid, list(colours), seen, surfaces,
        hollow if vessels else None,
    )  # fmt: skip


def of_objects(estimate: SceneEstimate) -> Float32:
    """The signed distances (X, Y, Z) without dips that are not objects, as they cast shadows."""
    grid = estimate.grid
    away = ndimage.distance_transform_edt(estimate.instances == 0) - 1.0
    least = np.minimum(away * grid.voxel_size, grid.truncation)
    return np.maximum(estimate.tsdf, np.where(estimate.instances == 0, least, -np.inf)).astype(
        np.float32
    )


def _vessels(estimate: SceneEstimate) -> dict[int, tuple[Vessel, Pose]]:
    return {
        item.id: (item.placed.shape, item.placed.pose)
        for item in estimate.objects
        if item.placed is not None and isinstance(item.placed.shape, Vessel)
    }


def _about(estimate: SceneEstimate, label: int) -> tuple[slice, ...]:
    """Voxels about an object."""
    grid = estimate.grid
    mesh = next(item.mesh for item in estimate.objects if item.id == label)
    ends = [
        mesh.vertices.min(axis=0) - grid.truncation,
        mesh.vertices.max(axis=0) + grid.truncation,
    ]
    low, high = (np.clip(np.round(grid.to_voxels(end)), 0, grid.resolution) for end in ends)
    return tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
