"""Objects of a complete volume, from views of it on all sides."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
import torch
from scipy import ndimage

from scenefw.core.batches import Completion
from scenefw.core.errors import InputError
from scenefw.kernels.cameras import stack_cameras

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray
    from torch import Tensor

    from scenefw.core.protocols import MappingMethod, Renderer
    from scenefw.core.types import Camera, GridSpec, Int32
    from scenefw_decomposing.protocols import SeveralViewsReconstructor


class Surround(Protocol):
    """Places cameras on all sides of a scene."""

    def around(self, centre: ArrayLike, radius: float) -> Sequence[Camera]:
        """Cameras that see a sphere (m)."""


@dataclass(frozen=True, eq=False)
class AllSides:
    """Decomposes complete volumes into objects, as if cameras had seen them from all sides.

    A complete scene doesn't say where one object ends and the next begins; depth images do, and
    methods for these are at hand. So the volume is rendered from all sides, the views are taken
    apart together, and each voxel of the volume goes to the object nearest to it. What is inside
    stays what it was.

    Args:
        reconstructor: finds the objects of several views.
        cameras: places the cameras.
        renderer: makes depth images of the volume.
        mapping: from depth to partial TSDF.
    """

    reconstructor: SeveralViewsReconstructor
    cameras: Surround
    renderer: Renderer
    mapping: MappingMethod

    def decompose(self, tsdf: Tensor, grid: GridSpec, generator: torch.Generator) -> Completion:
        """The objects of a volume.

        Args:
            tsdf: (1, 1, X, Y, Z) metres, of all objects together, without the floor.
            grid: of the volume.
            generator: for methods that draw.

        Raises:
            InputError: nothing is inside.
        """
        occupied = (tsdf[0, 0] < 0).cpu().numpy()
        if not occupied.any():
            raise InputError("the volume is empty; give one whose distances are negative inside")
        cameras = [
            stack_cameras([camera], tsdf.device)
            for camera in self.cameras.around(*ball(occupied, grid))
        ]
        images = [self.renderer.render(tsdf, grid, camera) for camera in cameras]
        views = [
            self.mapping.fuse(depth, grid, camera)
            for depth, camera in zip(images, cameras, strict=True)
        ]
        completion = self.reconstructor.complete_views(views, grid, 1, generator)[0]
        instances = spread(completion.instances[0].cpu().numpy(), occupied)
        return replace(
            completion,
            tsdf=tsdf[:, 0],
            instances=torch.from_numpy(instances)[None].to(tsdf.device),
        )


def ball(occupied: NDArray[np.bool_], grid: GridSpec) -> tuple[NDArray[np.float64], float]:
    """Centre (3,) and radius (m) of a ball about the box of some voxels (X, Y, Z)."""
    places = grid.centres()[occupied]
    low, high = places.min(axis=0), places.max(axis=0)
    return (low + high) / 2, float(np.linalg.norm(high - low) / 2 + grid.voxel_size)


def spread(instances: Int32, occupied: NDArray[np.bool_]) -> Int32:
    """The label (X, Y, Z) of the nearest labelled voxel, inside alone; 0 if there is no label."""
    if not (instances > 0).any():
        return np.zeros_like(instances)
    nearest = ndimage.distance_transform_edt(
        instances == 0, return_distances=False, return_indices=True
    )
    return np.where(occupied, instances[tuple(nearest)], 0).astype(np.int32)
