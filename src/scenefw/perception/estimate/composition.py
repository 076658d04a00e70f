"""Volumes of a hypothesis: superquadrics and vessels among rough volumes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from scipy.ndimage import binary_dilation

from scenefw.core.batches import Completion, SceneParameters
from scenefw.core.types import PlacedShape
from scenefw.core.weak_cache import cached_by_identity
from scenefw.fitting.placed import shape_of
from scenefw.representations.volumes import scene_volumes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from torch import Tensor

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Float32, Float64, GridSpec, Int32, TriangleMesh
    from scenefw.fitting.vessels import FittedVessel
    from scenefw.perception.observation.views import View
    from scenefw.perception.steps import Objects, ObjectSet
    from scenefw.shapes.object_shell import ObjectShell


def composed(hypothesis: ObjectSet, view: View) -> Completion:
    """The scene of a hypothesis, a batch of one on the device of the view.

    Args:
        hypothesis: whose volumes stay as they are if it has no superquadrics.
        view: that shows it.
    """
    objects, device = hypothesis.objects, view.partial.distance.device
    if hypothesis.superquadrics is None:
        if objects.tsdf is None or objects.instances is None:
            raise TypeError("a hypothesis needs superquadrics or volumes")
        tsdf, instances = objects.tsdf, objects.instances
    else:
        tsdf, instances = with_superquadrics(objects, hypothesis.superquadrics, view.grid)
        tsdf, instances = with_vessels(tsdf, instances, hypothesis.vessels, view.grid)
    meshes = {} if hypothesis.superquadrics is not None else dict(objects.meshes)
    shapes = hypothesis.superquadrics or {}
    placed = {k: PlacedShape(shape_of(shape), shape.pose) for k, shape in shapes.items()}
    placed |= {k: PlacedShape(v.shape, v.pose) for k, v in hypothesis.vessels.items()}
    masks = objects.masks
    return Completion(
        torch.from_numpy(tsdf)[None].to(device),
        torch.from_numpy(instances)[None].to(device),
        objects.volumes,
        None if masks is None else torch.from_numpy(masks)[None].to(device),
        () if hypothesis.superquadrics is None else (placed,),
        (meshes,) if meshes else (),
    )


def shell_meshes(shells: Mapping[int, ObjectShell]) -> dict[int, TriangleMesh]:
    """Closed meshes of shells, by label; those without volume have none."""
    meshes = {label: _shell_mesh(shell) for label, shell in shells.items()}
    return {label: mesh for label, mesh in meshes.items() if mesh is not None}


@cached_by_identity
def _shell_mesh(shell: ObjectShell) -> TriangleMesh | None:
    return shell.mesh(shell.voxel)


def with_shells(
    tsdf: Float32, instances: Int32, shells: Mapping[int, ObjectShell], grid: GridSpec
) -> tuple[Float32, Int32]:
    """TSDF and instances (X, Y, Z) with shells, by label, in place of what was there."""
    for label, shell in shells.items():
        box = grid.box_about(shell.places())
        distance = shell.signed_distance(grid.centres()[box])
        tsdf, instances = _replaced(tsdf, instances, label, box, distance, grid)
    return tsdf, instances


def with_superquadrics(
    objects: Objects, superquadrics: Mapping[int, FittedSuperquadric], grid: GridSpec
) -> tuple[Float32, Int32]:
    """TSDF and instances (X, Y, Z) of superquadrics, and of the objects that stay as they are.

    Args:
        objects: with their volumes, if there are some.
        superquadrics: by label.
        grid: of the volumes.
    """
    tsdf = np.full(grid.shape, grid.truncation, np.float32)
    instances = np.zeros(grid.shape, np.int32)
    if objects.tsdf is not None and objects.instances is not None:
        instances = np.where(np.isin(objects.instances, list(superquadrics)), 0, objects.instances)
        reach = round(grid.truncation / grid.voxel_size)
        shell = binary_dilation(instances > 0, iterations=reach) & (objects.instances == 0)
        tsdf = np.where((instances > 0) | shell, objects.tsdf, tsdf)
    if superquadrics:
        labels = np.array(list(superquadrics), np.int32)
        volumes = scene_volumes(_parameters(list(superquadrics.values())), grid)
        sharp_tsdf, owner = volumes.tsdf[0, 0].numpy(), volumes.instances[0].numpy()
        closer = sharp_tsdf < tsdf
        instances = np.where(
            closer & (owner > 0), labels[np.maximum(owner - 1, 0)], np.where(closer, 0, instances)
        )
        tsdf = np.minimum(tsdf, sharp_tsdf)
    return tsdf.astype(np.float32), np.where(tsdf < 0, instances, 0).astype(np.int32)


def with_vessels(
    tsdf: Float32, instances: Int32, vessels: Mapping[int, FittedVessel], grid: GridSpec
) -> tuple[Float32, Int32]:
    """TSDF and instances (X, Y, Z) with vessels, by label, in place of what was there."""
    for label, vessel in vessels.items():
        corners = vessel.shape.mesh().vertices + vessel.pose.position
        box = grid.box_about(corners)
        distance = vessel.shape.filled_distance(grid.centres()[box] - vessel.pose.position)
        tsdf, instances = _replaced(tsdf, instances, label, box, distance, grid)
    return tsdf, instances


def _replaced(
    tsdf: Float32,
    instances: Int32,
    label: int,
    box: tuple[slice, ...],
    distance: Float64,
    grid: GridSpec,
) -> tuple[Float32, Int32]:
    """TSDF and instances with another shape of an object, given by its distance in a box."""
    is_old = instances == label
    tsdf = np.where(is_old, np.float32(grid.truncation), tsdf)
    instances = np.where(is_old, 0, instances)
    closer = (instances[box] == 0) & (distance < tsdf[box])
    instances[box] = np.where(closer & (distance < 0), label, instances[box])
    tsdf[box] = np.where(closer, distance, tsdf[box])
    return tsdf.astype(np.float32), np.where(tsdf < 0, instances, 0).astype(np.int32)


def _parameters(shapes: Sequence[FittedSuperquadric]) -> SceneParameters:
    def stacked(rows: Sequence[Any]) -> Tensor:
        return torch.from_numpy(np.stack(rows)[None].astype(np.float32))

    return SceneParameters(
        stacked([shape.half_axes for shape in shapes]),
        stacked([shape.exponents for shape in shapes]),
        stacked([shape.pose.rotation for shape in shapes]),
        stacked([shape.pose.position for shape in shapes]),
        torch.ones(1, len(shapes), dtype=torch.bool),
    )
