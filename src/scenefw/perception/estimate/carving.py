"""Removes from a prediction what the depth image contradicts."""

from collections.abc import Collection

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor
from torch.nn import functional

from scenefw.core.batches import PartialTSDF
from scenefw.core.types import GridSpec
from scenefw.perception.observation.components import EDGE


def carve(tsdf: Tensor, partial: PartialTSDF, grid: GridSpec) -> Tensor:
    """The TSDF (X, Y, Z) without anything below the floor or in observed free space.

    A distance along rays is never smaller than the true one, so of seen space only the sign is
    used, only a voxel and more in front of the surface, and not beside space that isn't free: at
    silhouettes the prediction is smoother than what was seen.

    Args:
        tsdf: (X, Y, Z) metres.
        partial: of the same scene, a batch of one.
        grid: the voxel grid of both.
    """
    voxel = grid.voxel_size
    heights = torch.from_numpy(grid.centres()[0, 0, :, 2].astype(np.float32)).to(tsdf.device)
    distance = partial.distance[0, 0].to(tsdf.device)
    free = partial.observed[0, 0].to(tsdf.device) & (distance > voxel)
    beside_occupied = functional.max_pool3d((~free).float()[None, None], 3, stride=1, padding=1)[
        0, 0
    ]
    carved = torch.where(beside_occupied == 0, tsdf.clamp(min=voxel / 2), tsdf)
    return torch.maximum(carved, -heights).clamp(max=grid.truncation)


def whole_objects(
    tsdf: Tensor, instances: Tensor, grid: GridSpec, lasting: Collection[int] = ()
) -> tuple[Tensor, Tensor]:
    """TSDF and instances (X, Y, Z) in which each instance is in one piece.

    The largest connected part of an instance keeps its place among the labels, which are renumbered
    1..N; a further part becomes an instance of its own, at the end, if it is large enough for an
    object. What is left is taken away, as is what is inside without an instance.

    Args:
        tsdf: (X, Y, Z) metres.
        instances: (X, Y, Z) labels.
        grid: of both.
        lasting: labels of objects that stay, and have no further part.
    """
    inside = (tsdf < 0).cpu().numpy()
    labels = np.where(inside, instances.cpu().numpy(), 0)
    new_labels = np.zeros(labels.shape, dtype=np.int32)
    main_parts, further_parts = [], []
    min_volume = EDGE**3  # less is a fragment
    for label, box in enumerate(ndimage.find_objects(labels), start=1):
        if box is None:
            continue
        parts, _ = ndimage.label(labels[box] == label)
        volumes = np.bincount(parts.ravel())[1:] * grid.voxel_size**3
        order = np.argsort(-volumes, kind="stable")
        if label in lasting:
            if volumes[order[0]] >= min_volume:
                new_labels[box][parts == order[0] + 1] = label
            continue
        if volumes[order[0]] >= min_volume:
            main_parts.append((box, parts == order[0] + 1))
        further_parts += [(box, parts == i + 1) for i in order[1:] if volumes[i] >= min_volume]
    first_number = max(lasting, default=0) + 1
    for number, (box, mask) in enumerate([*main_parts, *further_parts], start=first_number):
        new_labels[box][mask] = number
    leftover = torch.from_numpy(inside & (new_labels == 0)).to(tsdf.device)
    shape = torch.where(leftover, torch.full_like(tsdf, grid.voxel_size / 2), tsdf)
    return shape, torch.from_numpy(new_labels).to(instances.device)
