"""Depth images of the shapes of scenes themselves, in place of their volumes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from scenefw.kernels.cameras import floor_depths

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import CameraBatch, SeenSurface
    from scenefw.core.protocols import SceneBatch, SurfaceRenderer
    from scenefw.core.types import GridSpec

_LEAST_SLOPE = 1e-4  # metres of descent per metre of depth; flatter rays see no floor


class ExactShapes:
    """Renders known scenes by rays that meet their superquadrics or triangles.

    Edges are as sharp as a camera sees them, whatever the grid. In images traced through a volume
    they are about a voxel round. What is known as a volume alone is left to another renderer.

    Args:
        volumes: renders volumes.
        floor: also hit the plane z = 0.
    """

    def __init__(self, volumes: SurfaceRenderer, *, floor: bool = True) -> None:
        self.volumes, self.floor = volumes, floor

    def render(self, tsdf: Tensor, grid: GridSpec, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of TSDFs (B, 1, X, Y, Z) in metres; 0 = nothing hit."""
        return self.volumes.render(tsdf, grid, cameras)

    def render_surface(
        self, tsdf: Tensor, instances: Tensor, grid: GridSpec, cameras: CameraBatch
    ) -> SeenSurface:
        """Depth, normals and labels of TSDFs (B, 1, X, Y, Z) m and instances (B, X, Y, Z)."""
        return self.volumes.render_surface(tsdf, instances, grid, cameras)

    def render_scenes(self, scenes: SceneBatch, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of the shapes of known scenes; 0 = nothing hit."""
        depth = scenes.depth(cameras)
        if not self.floor:
            return depth
        ground = floor_depths(cameras, _LEAST_SLOPE / 2)
        height = cameras.T_world_camera[:, 2, 3, None, None]
        ground = torch.where((ground > 0) & (ground * _LEAST_SLOPE < height), ground, 0)
        nearer = (ground > 0) & ((depth == 0) | (ground < depth))
        return torch.where(nearer, ground, depth)
