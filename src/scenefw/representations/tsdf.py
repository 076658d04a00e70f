"""Truncated signed distance of scenes."""

import torch
from torch import Tensor

from scenefw.core.protocols import SceneBatch
from scenefw.core.types import GridSpec


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

    Networks have it in units of the truncation, within [-1, 1].

    Args:
        floor: the floor z = 0 counts as surface.
    """

    channels = 1

    def __init__(self, *, floor: bool = False) -> None:
        self.floor = floor

    def of_scenes(self, scenes: SceneBatch) -> Tensor:
        """(B, 1, X, Y, Z) float32 metres."""
        tsdf = scenes.volumes.tsdf
        return with_floor(tsdf, scenes.grid) if self.floor else tsdf

    def to_network(self, volume: Tensor, grid: GridSpec) -> Tensor:
        """In units of the truncation."""
        return (volume / grid.truncation).clamp(-1, 1)

    def from_network(self, output: Tensor, grid: GridSpec) -> Tensor:
        """In metres."""
        return output.float() * grid.truncation
