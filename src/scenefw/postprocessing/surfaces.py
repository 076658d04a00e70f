"""Surfaces of signed distance volumes: of the whole scene, and watertight ones of each instance."""

from collections.abc import Collection

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from skimage import measure
from torch import Tensor

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec, TriangleMesh

Array = NDArray[np.float32]

# Marching cubes puts a vertex into a corner of a cube where the field is 0 there; such vertices
# coincide and leave faces without area, so fields keep this share of a voxel away from 0.
_CLEARANCE = 1e-3
_MARGIN = 3


def surface(tsdf: Tensor | ArrayLike, grid: GridSpec) -> TriangleMesh | None:
    """The closed surface tsdf = 0 by marching cubes, or None if there is none.

    Args:
        tsdf: (X, Y, Z) metres; what is inside at the grid's border is closed there.
        grid: its voxel grid.

    Returns:
        World coordinates, faces counter-clockwise seen from outside.

    Raises:
        InputError: the shape does not fit the grid, or values are not finite.
    """
    field = _field(tsdf, grid)
    inside = field < 0
    if not inside.any():
        return None
    box = _box(inside, 1)
    return _marching_cubes(field[box], [span.start for span in box], grid)


def instance_meshes(
    tsdf: Tensor | ArrayLike,
    instances: Tensor | ArrayLike,
    grid: GridSpec,
    smoothing: float = 1.0,
    selection: Collection[int] | None = None,
) -> dict[int, TriangleMesh]:
    """A watertight surface of each instance in world coordinates, by label.

    The field of an instance is max(tsdf, s): s is the signed distance to where space is as near to
    the instance's voxels as to those of other instances, smoothed so that touching objects part
    along a plane and not along voxel faces. It is negative on the instance's side.

    Args:
        tsdf: (X, Y, Z) metres.
        instances: (X, Y, Z) labels, 0 = no object.
        grid: the voxel grid of both.
        smoothing: standard deviation of the Gaussian over s (voxels).
        selection: labels of which surfaces are made; None: all.

    Raises:
        InputError: shapes do not fit the grid, or values are not finite.
    """
    meshes = {}
    fields = instance_fields(tsdf, instances, grid, smoothing, selection)
    for label, (around, field) in fields.items():
        if (field < 0).any():
            meshes[label] = _marching_cubes(field, [span.start for span in around], grid)
    return meshes


def instance_fields(
    tsdf: Tensor | ArrayLike,
    instances: Tensor | ArrayLike,
    grid: GridSpec,
    smoothing: float = 1.0,
    selection: Collection[int] | None = None,
) -> dict[int, tuple[tuple[slice, ...], Array]]:
    """The field of each instance by label, in a box of the grid, as `instance_meshes` takes it.

    Args:
        tsdf: (X, Y, Z) metres.
        instances: (X, Y, Z) labels, 0 = no object.
        grid: the voxel grid of both.
        smoothing: of the cuts between instances (voxels).
        selection: labels of which fields are made; None: all.

    Raises:
        InputError: shapes do not fit the grid, or values are not finite.
    """
    field, labels = _field(tsdf, grid), _numpy(instances)
    if labels.shape != grid.shape:
        raise InputError(f"instances have shape {labels.shape}, expected {grid.shape} as the grid")
    fields = {}
    for label, box in enumerate(ndimage.find_objects(labels.astype(np.int64)), start=1):
        if box is not None and (selection is None or label in selection):
            around = _grown(box, _MARGIN, grid)
            instance_field = _separated(
                field[around], labels[around], label, smoothing, grid.voxel_size
            )
            fields[label] = (around, instance_field)
    return fields


def _separated(
    field: Array, labels: NDArray[np.int64], label: int, smoothing: float, voxel: float
) -> Array:
    object_mask = labels == label
    neighbour_mask = (labels > 0) & ~object_mask
    if not neighbour_mask.any():
        return field
    separation = ndimage.distance_transform_edt(~object_mask) - ndimage.distance_transform_edt(
        ~neighbour_mask
    )
    separation *= 0.5 * voxel
    smooth = np.maximum(field, ndimage.gaussian_filter(separation, smoothing))
    # Smoothing may swallow an instance of a few voxels: it keeps its blocky cut then.
    return smooth if (smooth < 0).any() else np.maximum(field, separation)


def _marching_cubes(field: Array, corner: list[int], grid: GridSpec) -> TriangleMesh:
    clearance = _CLEARANCE * grid.voxel_size
    field = np.where(np.abs(field) < clearance, np.where(field < 0, -clearance, clearance), field)
    padded = np.pad(field, 1, constant_values=grid.voxel_size)
    vertices, faces, _, _ = measure.marching_cubes(
        padded.astype(np.float32), 0.0, gradient_direction="descent"
    )
    voxels = vertices.astype(np.float64) - 1 + np.asarray(corner)
    return TriangleMesh(grid.to_world(voxels), faces.astype(np.int64))


def _box(mask: NDArray[np.bool_], margin: int) -> tuple[slice, ...]:
    spans = []
    for axis, size in enumerate(mask.shape):
        hits = np.flatnonzero(mask.any(axis=tuple(a for a in range(3) if a != axis)))
        spans.append(slice(max(0, hits[0] - margin), min(size, hits[-1] + 1 + margin)))
    return tuple(spans)


def _grown(box: tuple[slice, ...], margin: int, grid: GridSpec) -> tuple[slice, ...]:
    return tuple(
        slice(max(0, span.start - margin), min(grid.resolution, span.stop + margin)) for span in box
    )


def _field(tsdf: Tensor | ArrayLike, grid: GridSpec) -> Array:
    field = _numpy(tsdf).astype(np.float32)
    if field.shape != grid.shape:
        raise InputError(
            f"tsdf has shape {field.shape}, expected {grid.shape}; give one scene without its "
            "batch dimension"
        )
    if not np.isfinite(field).all():
        raise InputError("tsdf contains NaN or infinity; expected finite distances in metres")
    return field


def _numpy(values: Tensor | ArrayLike) -> np.ndarray:
    return values.detach().cpu().numpy() if isinstance(values, torch.Tensor) else np.asarray(values)
