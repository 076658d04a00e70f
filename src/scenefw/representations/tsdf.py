"""Truncated signed distance of scenes."""

import torch
from torch import Tensor

from scenefw.core.batches import SceneParameters
from scenefw.core.types import GridSpec
from scenefw.representations.volumes import scene_volumes


def with_floor(tsdf: Tensor, grid: GridSpec) -> Tensor:
    """The TSDF of the same scenes standing on the floor z = 0.

    Args:
        tsdf: (..., X, Y, Z) metres, objects alone.
        grid: its voxel grid.

    Returns:
        The smaller of `tsdf` and the truncated height over the floor, of the same shape.
    """
    heights = grid.lower[2] + (torch.arange(grid.resolution) + 0.5) * grid.voxel_size
    floor = heights.clamp(-grid.truncation, grid.truncation).to(tsdf)
    return torch.minimum(tsdf, floor)


class TSDF:
    """Signed distance to the objects, negative inside, cut at +-truncation (m).

    Args:
        floor: the floor z = 0 counts as surface.
    """

    def __init__(self, *, floor: bool = False) -> None:
        self.floor = floor

    def of_scenes(self, parameters: SceneParameters, grid: GridSpec) -> Tensor:
        """(B, 1, X, Y, Z) float32 metres."""
        tsdf = scene_volumes(parameters, grid).tsdf
        return with_floor(tsdf, grid) if self.floor else tsdf
