"""Takes away from a prediction what the depth image contradicts."""

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor

from scenefw.core.types import GridSpec, PartialTSDF

_SMALLEST = 3e-5  # m^3: less is a splinter, no object


def carve(tsdf: Tensor, partial: PartialTSDF, grid: GridSpec) -> Tensor:
    """The TSDF (X, Y, Z) without what lies below the floor or in space that was seen to be free.

    A distance along rays is never smaller than the true one, so of seen space only the sign is
    used, and only a voxel and more in front of the surface.

    Args:
        tsdf: (X, Y, Z) metres.
        partial: of the same scene, a batch of one.
        grid: the voxel grid of both.
    """
    voxel = grid.voxel_size
    heights = torch.from_numpy(grid.centres()[0, 0, :, 2].astype(np.float32)).to(tsdf.device)
    seen = partial.distance[0, 0].to(tsdf.device)
    free = partial.observed[0, 0].to(tsdf.device) & (seen > voxel)
    carved = torch.where(free, tsdf.clamp(min=voxel / 2), tsdf)
    return torch.maximum(carved, -heights).clamp(max=grid.truncation)


def whole_objects(tsdf: Tensor, instances: Tensor, grid: GridSpec) -> tuple[Tensor, Tensor]:
    """TSDF and instances (X, Y, Z) without splinters: connected parts too small for an object.

    Instances keep their voxels inside the TSDF alone, and are renumbered 1..N in their order. What
    is inside without an instance is taken away as well.
    """
    inside = (tsdf < 0).cpu().numpy()
    labels = np.where(inside, instances.cpu().numpy(), 0)
    kept = np.zeros_like(labels)
    number = 0
    for label in np.unique(labels[labels > 0]):
        parts, _ = ndimage.label(labels == label)
        large = np.bincount(parts.ravel()) * grid.voxel_size**3 >= _SMALLEST
        large[0] = False
        if large.any():
            number += 1
            kept[large[parts]] = number
    outside = torch.from_numpy(inside & (kept == 0)).to(tsdf.device)
    shape = torch.where(outside, torch.full_like(tsdf, grid.voxel_size / 2), tsdf)
    return shape, torch.from_numpy(kept.astype(np.int32)).to(instances.device)
