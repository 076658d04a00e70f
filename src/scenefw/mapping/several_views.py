"""Partial TSDFs of several views of one scene, as one (thesis 5.3.1)."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.ndimage import binary_erosion

from scenefw.core.batches import CameraBatch, PartialTSDF
from scenefw.core.errors import InputError
from scenefw.core.geometry import transform_points
from scenefw.kernels.cameras import camera_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Float64, GridSpec

_DEEP = 0.03  # m: a point this far inside what another view saw free contradicts it
_FLOOR = 0.01  # m: points below are of the floor, on which all scenes agree
_CONTRADICTING = 0.4  # share of such points that no noise explains
_POINTS = 4000  # of a view that are asked


def fused(views: Sequence[PartialTSDF], grid: GridSpec) -> PartialTSDF:
    """One partial TSDF of several views: the smaller |distance| wins (eq. 5.19).

    A voxel is observed if any view observes it. The result has no image, unless there is one view.

    Args:
        views: of one scene, batches of one.
        grid: of all.

    Raises:
        InputError: no view, views of other grids, or views that contradict each other.
    """
    require_agreement(views, grid)
    return reduce(PartialTSDF.merge, views)


def stacked(views: Sequence[PartialTSDF]) -> PartialTSDF:
    """Several views as one batch, images and cameras too.

    Raises:
        InputError: no view, or a view without its image.
    """
    images, cameras = _images(views), _cameras(views)
    return PartialTSDF(
        torch.cat([view.distance for view in views]),
        torch.cat([view.observed for view in views]),
        images,
        cameras,
    )


def require_agreement(views: Sequence[PartialTSDF], grid: GridSpec) -> None:
    """Checks that views can be of one scene.

    Raises:
        InputError: no view, views of other grids, or a view most of whose objects stand where
            another one saw free space.
    """
    if not views:
        raise InputError("there is no view; give at least one depth image with its pose")
    shape = (1, 1, *grid.shape)
    for number, view in enumerate(views, start=1):
        if tuple(view.distance.shape) != shape:
            raise InputError(
                f"view {number} is on a grid of shape {tuple(view.distance.shape)}, expected "
                f"{shape}; fuse all views on one grid"
            )
    if len(views) == 1 or any(view.depth is None or view.cameras is None for view in views):
        return
    points = [_object_points(view, grid) for view in views]
    free = [_free(view, grid) for view in views]
    for i, places in enumerate(points):
        for j, empty in enumerate(free):
            if i == j or len(places) < 50:
                continue
            share = float(empty[tuple(places.T)].mean())
            if share > _CONTRADICTING:
                raise InputError(
                    f"views {min(i, j) + 1} and {max(i, j) + 1} contradict each other: {share:.0%} "
                    f"of the object points of view {i + 1} lie where view {j + 1} saw free space; "
                    "give views of one scene, with poses in one world frame"
                )


def _free(view: PartialTSDF, grid: GridSpec) -> np.ndarray:
    """Voxels (X, Y, Z) that are free together with all that is `_DEEP` around them."""
    free = (view.observed & (view.distance > 0.9 * grid.voxel_size))[0, 0].cpu().numpy()
    return binary_erosion(free, iterations=max(1, round(_DEEP / grid.voxel_size)))


def _object_points(view: PartialTSDF, grid: GridSpec) -> np.ndarray:
    """Voxels (P, 3) of what a view shows above the floor."""
    points = _world(view)
    points = points[points[:, 2] > _FLOOR]
    points = points[:: max(1, len(points) // _POINTS)]
    voxels, inside = grid.nearest_voxels(points)
    return voxels[inside]


def _world(view: PartialTSDF) -> Float64:
    """World coordinates (P, 3) of the pixels of one view that measured something."""
    camera = camera_of(_cameras([view]), 0)
    depth = _images([view])[0].double().cpu().numpy()
    v, u = np.nonzero(depth > 0)
    z = depth[v, u]
    local = np.stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z], axis=1)
    return transform_points(camera.T_world_camera, local)


def _images(views: Sequence[PartialTSDF]) -> torch.Tensor:
    images = [view.depth for view in views if view.depth is not None]
    if len(images) < len(views) or not images:
        raise InputError(
            "several views are used with their depth images; their mapping left them out"
        )
    if len({tuple(image.shape[1:]) for image in images}) > 1:
        raise InputError("views have several image sizes; resize them to one")
    return torch.cat(images)


def _cameras(views: Sequence[PartialTSDF]) -> CameraBatch:
    cameras = [view.cameras for view in views if view.cameras is not None]
    return CameraBatch(
        cameras[0].width,
        cameras[0].height,
        torch.cat([camera.intrinsics for camera in cameras]),
        torch.cat([camera.T_world_camera for camera in cameras]),
    )
