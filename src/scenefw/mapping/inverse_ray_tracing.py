"""Partial TSDFs by inverse ray tracing: every pixel's ray spreads its distances over the grid."""

import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch, PartialTSDF
from scenefw.core.settings import NOT_NEGATIVE, POSITIVE
from scenefw.core.types import GridSpec
from scenefw.kernels import partial
from scenefw.kernels.cameras import require_depth
from scenefw.kernels.compile import float32

_SLOTS_PER_SCENE = (
    4  # private grids per scene on a CPU; fixed, so that sums don't vary with threads
)


class InverseRayTracing:
    """Spreads samples of each pixel's ray over the voxels around them (thesis 5.2.1, eq. 5.7).

    Samples lie every `step` along a ray, up to `behind` past the surface, and are spread over eight
    voxels with trilinear weights. What eq. 5.7 leaves open or gets wrong:

    - weights are normalised: a voxel is the weighted mean of the samples that touch it;
    - each sample's distance is carried on along its ray to the voxel's own plane, else the mean
      would follow the positions of the samples instead of the voxel's;
    - of the samples that touch a voxel, those more than two voxels farther from their own surface
      than the closest one don't count: the nearest surface wins;
    - samples of neighbouring rays are staggered, so that no resolution leaves gaps between steps;
    - samples farther in front than the truncation are left out: free space is +truncation.

    Untouched voxels, seen free space and unseen space alike, are +truncation. `observed` is true
    for voxel centres that project in front of the measured surface or up to one voxel behind it.
    Results don't depend on the number of threads; on CUDA sums vary in their last bits.

    Args:
        step: distance between samples of a ray (m).
        behind: how far behind the surface sampling goes on (m).
    """

    def __init__(self, step: float = 0.025, behind: float = 0.01) -> None:
        POSITIVE.require(step=step)
        NOT_NEGATIVE.require(behind=behind)
        self.step = step
        self.behind = behind

    def fuse(self, depth: Tensor, grid: GridSpec, cameras: CameraBatch) -> PartialTSDF:
        """Partial TSDF of each of B depth images (B, H, W), metres, 0 = no measurement.

        Raises:
            InputError: depth and cameras disagree in size or device.
        """
        depth = require_depth(depth, cameras)
        slots = 1 if depth.is_cuda else _SLOTS_PER_SCENE
        view = (depth.view(-1), cameras.intrinsics, cameras.T_world_camera)
        size = (grid.resolution, cameras.width, cameras.height)
        box = float32(grid.voxel_size, *grid.lower, grid.truncation)
        sampling = float32(self.step, self.behind)
        cells = (len(depth), slots, (grid.resolution + 3) ** 3)
        closest = depth.new_full(cells, float(partial.NO_SAMPLE))
        partial.find_nearest(depth.numel(), slots, *view, closest.view(-1), size, box, sampling)
        limits = _limits(closest, grid)
        sums = depth.new_zeros(slots * limits.numel() * 2)
        partial.spread(depth.numel(), slots, *view, limits, sums, size, box, sampling)
        shape = (len(depth), 1, *grid.shape)
        distance = torch.empty(shape, dtype=torch.float32, device=depth.device)
        observed = torch.empty(shape, dtype=torch.bool, device=depth.device)
        voxels = distance.numel()
        partial.project(voxels, *view, distance.view(-1), observed.view(-1), size, box)
        partial.normalise(voxels, slots, sums, distance.view(-1), size, box)
        return PartialTSDF(distance, observed, depth, cameras)


def _limits(closest: Tensor, grid: GridSpec) -> Tensor:
    """Per padded voxel the largest |distance| (voxels) at which a sample counts."""
    padded = grid.resolution + 2
    limits = closest.new_empty(len(closest) * padded**3)
    partial.set_limits(len(limits), closest.amin(dim=1).view(-1), limits, padded)
    return limits
