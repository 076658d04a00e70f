"""Projective TSDFs: every voxel looks itself up in the depth image."""

import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch, PartialTSDF
from scenefw.core.types import GridSpec
from scenefw.kernels import partial
from scenefw.kernels.cameras import require_depth
from scenefw.kernels.compile import float32


class Projective:
    """Standard projective TSDF (Curless and Levoy 1996; Newcombe et al. 2011), one view per scene.

    Each voxel centre projects to its nearest pixel. Its distance runs along its own ray to that
    pixel's z-depth, so it agrees with inverse ray tracing. Farther than the truncation behind the
    surface, outside the image and where nothing was measured it is +truncation. `observed` is true
    in front of the measured surface and up to one voxel behind it.
    """

    def fuse(self, depth: Tensor, grid: GridSpec, cameras: CameraBatch) -> PartialTSDF:
        """Partial TSDF of each of B depth images (B, H, W), metres, 0 = no measurement.

        Raises:
            InputError: depth and cameras disagree in size or device.
        """
        depth = require_depth(depth, cameras)
        shape = (len(depth), 1, *grid.shape)
        distance = torch.empty(shape, dtype=torch.float32, device=depth.device)
        observed = torch.empty(shape, dtype=torch.bool, device=depth.device)
        partial.project(
            distance.numel(), depth.view(-1),
            cameras.intrinsics, cameras.T_world_camera, distance.view(-1), observed.view(-1),
            (grid.resolution, cameras.width, cameras.height),
            float32(grid.voxel_size, *grid.lower, grid.truncation),
        )  # fmt: skip
        return PartialTSDF(distance, observed, depth, cameras)
