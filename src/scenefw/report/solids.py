"""Predicted scenes as what pictures are drawn from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from scenefw.report.palette import instance_colours
from scenefw.report.shading import Solid
from scenefw.report.surfaces import Surfaces
from scenefw.shapes.vessel import Vessel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Float32, SceneEstimate
    from scenefw.report.palette import Colour


def solids_of(estimates: Sequence[SceneEstimate]) -> list[Solid]:
    """Scenes of one image made ready for drawing: objects of the same id have the same colour."""
    labels = [int(estimate.instances.max()) for estimate in estimates]
    ids = [item.id for estimate in estimates for item in estimate.objects]
    colours = instance_colours(max([1, *labels, *ids]))
    return [solid_of(estimate, colours) for estimate in estimates]


def solid_of(
    estimate: SceneEstimate, colours: Sequence[Colour], visibility: Float32 | None = None
) -> Solid:
    """A predicted scene with the surfaces of its objects, and shadows as of its volume.

    Args:
        estimate: the scene.
        colours: red, green, blue in [0, 1] by label.
        visibility: (X, Y, Z) in [0, 1]; surfaces are pale where it is 0. None = nowhere.
    """
    surfaces = Surfaces({item.id: item.mesh for item in estimate.objects})
    field, hollow = of_objects(estimate), None
    for item in estimate.objects:
        if item.placed is None or not isinstance(item.placed.shape, Vessel):
            continue
        shape, pose = item.placed.shape, item.placed.pose
        hollow = field.copy() if hollow is None else hollow
        box = estimate.grid.box_about(item.mesh.vertices)
        local = (estimate.grid.centres()[box] - pose.position) @ pose.rotation
        filled = shape.filled_distance(local)
        neighbour_distance = np.where(
            estimate.instances[box] == item.id, np.inf, estimate.tsdf[box]
        )
        opened = np.minimum(shape.wall_distance(local), neighbour_distance)
        hollow[box] = np.where(filled < 0, opened, hollow[box])
        field[box] = np.minimum(field[box], filled)
    return Solid(
        field, estimate.instances, estimate.grid, list(colours), visibility, surfaces, hollow,
        truncated=False,
    )  # fmt: skip


def of_objects(estimate: SceneEstimate) -> Float32:
    """The signed distances (X, Y, Z) without dips that are not objects, as they cast shadows.

    Beyond the truncation they are those to the nearest voxel of an object.
    """
    outside = estimate.instances == 0
    if outside.all():
        return np.full(outside.shape, estimate.grid.extent, dtype=np.float32)
    distance = (ndimage.distance_transform_edt(outside) - 1.0) * estimate.grid.voxel_size
    return np.where(outside, np.maximum(estimate.tsdf, distance), estimate.tsdf).astype(np.float32)
