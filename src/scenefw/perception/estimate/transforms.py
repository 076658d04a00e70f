"""Scene estimates whose objects were moved or taken away: meshes, poses, shapes and volumes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from scipy.ndimage import map_coordinates

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import (
    Float32,
    Float64,
    GridSpec,
    Int32,
    ObjectEstimate,
    Obstacle,
    PlacedShape,
    Pose,
    SceneEstimate,
    TriangleMesh,
)
from scenefw.postprocessing.surfaces import instance_fields


def moved(estimate: SceneEstimate, motions: Mapping[int, Float64]) -> SceneEstimate:
    """The estimate with some of its objects elsewhere.

    What belongs to the image stays: the frame, the masks and the volumes of other representations.

    Args:
        estimate: a scene.
        motions: rigid 4x4 in world coordinates, by id of the object; the others stay.
    """
    objects = tuple(
        moved_object(item, motions[item.id]) if item.id in motions else item
        for item in estimate.objects
    )
    tsdf, instances = _volumes(estimate, motions)
    return replace(estimate, objects=objects, tsdf=tsdf, instances=instances)


def without(estimate: SceneEstimate, ids: Collection[int]) -> SceneEstimate:
    """The estimate without some of its objects, which its volumes and masks lose too.

    What belongs to the image stays, as in `moved`.

    Args:
        estimate: a scene.
        ids: of the objects.
    """
    objects = tuple(item for item in estimate.objects if item.id not in ids)
    tsdf, instances = _volumes(estimate, {}, ids)
    masks = estimate.masks
    if masks is not None:
        masks = np.where(np.isin(masks, list(ids)), 0, masks).astype(np.int32)
    return replace(estimate, objects=objects, tsdf=tsdf, instances=instances, masks=masks)


def moved_object(item: ObjectEstimate, motion: Float64) -> ObjectEstimate:
    """An object elsewhere: its mesh, pose and shape.

    Args:
        item: as it was.
        motion: rigid 4x4 in world coordinates.
    """
    mesh = TriangleMesh(transform_points(motion, item.mesh.vertices), item.mesh.faces)
    placed = item.placed and PlacedShape(item.placed.shape, _pose(motion, item.placed.pose))
    return replace(item, mesh=mesh, pose=_pose(motion, item.pose), placed=placed)


def moved_obstacle(obstacle: Obstacle, motion: Float64) -> Obstacle:
    """An obstacle elsewhere.

    Args:
        obstacle: as it was.
        motion: rigid 4x4.
    """
    mesh = obstacle.mesh
    moved_mesh = TriangleMesh(transform_points(motion, mesh.vertices), mesh.faces)
    return replace(obstacle, mesh=moved_mesh)


def joined(estimate: SceneEstimate, other: SceneEstimate) -> SceneEstimate:
    """A scene with the objects of another one, whose ids are others, in the same frame and grid.

    All else is that of the other one, but for volumes of other representations, which it loses;
    pixels of both show what the other one says.
    """
    objects = sorted([*estimate.objects, *other.objects], key=lambda item: item.id)
    closer = estimate.tsdf < other.tsdf
    masks = other.masks
    if masks is not None and estimate.masks is not None:
        masks = np.where(masks > 0, masks, estimate.masks)
    return replace(
        other,
        objects=tuple(objects),
        tsdf=np.where(closer, estimate.tsdf, other.tsdf),
        instances=np.where(closer, estimate.instances, other.instances),
        volumes={},
        masks=masks,
    )


def _pose(motion: Float64, pose: Pose) -> Pose:
    return Pose.from_matrix(motion @ pose.matrix)


def moved_field(field: Float32, grid: GridSpec, motion: Float64) -> Float32:
    """Distances (X, Y, Z) of what lies elsewhere; far from all where nothing is known (m).

    Args:
        field: distances as they were.
        grid: of both.
        motion: rigid 4x4.
    """
    source_points = transform_points(inverse(motion), grid.centres().reshape(-1, 3))
    places = grid.to_voxels(source_points).T
    values: Float32 = map_coordinates(field, places, order=1, cval=grid.truncation)
    return values.reshape(grid.shape)


def _volumes(
    estimate: SceneEstimate, motions: Mapping[int, Float64], removed_ids: Collection[int] = ()
) -> tuple[Float32, Int32]:
    """Distances and labels; each object's own field is resampled where it lies now."""
    grid = estimate.grid
    fields = instance_fields(estimate.tsdf, estimate.instances, grid)
    nearest = np.full(grid.shape, grid.truncation, dtype=np.float32)
    owner = np.zeros(grid.shape, dtype=np.int32)
    for label, (box, part) in fields.items():
        if label in removed_ids:
            continue
        field = np.full(grid.shape, grid.truncation, dtype=np.float32)
        field[box] = part
        if label in motions:
            field = moved_field(field, grid, motions[label])
        closer = field < nearest
        nearest[closer], owner[closer] = field[closer], label
    return nearest, np.where(nearest < 0, owner, 0).astype(np.int32)
