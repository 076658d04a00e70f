"""What depth images hold against a TSDF, with gradients (thesis 5.3.3)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import torch

from scenefw.core.errors import InputError
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.kernels.cameras import finite, require_depth
from scenefw.kernels.compile import float32
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw_several_views import view_cost

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import CameraBatch
    from scenefw.core.protocols import SceneBatch
    from scenefw.core.types import GridSpec

_SLOTS = 2  # private grids per view on a CPU; fixed, so that sums don't vary with threads


class Differentiable:
    """Renders TSDFs, and says with gradients how far they are from explaining depth images.

    The surface cost of a pixel is |distance| at the point that it measured (eq. 5.20, whose
    absolute value the thesis forgot), the empty-space cost the sum of what is negative at regular
    steps along its ray, from `margin` before that point to where the ray enters the grid (eq.
    5.21). Distances are those of objects alone, so points of the floor show only empty space.
    Gradients go to the eight voxels around each place. They are exact but where a distance is 0.

    Args:
        step: between samples of empty space (m).
        margin: as far before a surface nothing is asked of empty space (m).
        floor: what is lower shows the floor (m).
        stride: every how many rows and columns of the images are used.
        max_steps: upper bound of steps per ray of sphere tracing.
        tolerance: a ray stops this close to the surface (m).

    Raises:
        ConfigError: a step or stride that isn't positive, or a negative margin.
    """

    def __init__(
        self,
        step: float = 0.015,
        margin: float = 0.01,
        floor: float = 0.005,
        stride: int = 2,
        max_steps: int = 256,
        tolerance: float = 1e-4,
    ) -> None:
        POSITIVE.require(step=step)
        COUNT.require(stride=stride)
        NOT_NEGATIVE.require(margin=margin)
        self.step, self.margin, self.floor, self.stride = step, margin, floor, stride
        self.tracer = SphereTracer(max_steps, tolerance)

    def render(self, tsdf: Tensor, grid: GridSpec, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of TSDFs (B, 1, X, Y, Z) in metres; 0 = nothing hit."""
        return self.tracer.render(tsdf, grid, cameras)

    def render_scenes(self, scenes: SceneBatch, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of the volumes of known scenes; 0 = nothing hit."""
        return self.tracer.render_scenes(scenes, cameras)

    def costs(
        self, tsdf: Tensor, grid: GridSpec, depth: Tensor, cameras: CameraBatch
    ) -> tuple[Tensor, Tensor]:
        """Surface and empty-space cost of one scene in V views, with gradients.

        Both are sums over pixels, divided by the number of pixels that measured something.

        Args:
            tsdf: (X, Y, Z), in any unit; the costs are in the same.
            grid: of the TSDF.
            depth: (V, H, W) z-depth in metres, 0 = no measurement.
            cameras: V of them.

        Raises:
            InputError: the shapes don't fit, or no pixel measured anything.
        """
        if tuple(tsdf.shape) != grid.shape:
            raise InputError(
                f"the TSDF has shape {tuple(tsdf.shape)}, expected {grid.shape}; give one scene"
            )
        views, view_cameras = thinned(require_depth(depth, cameras), cameras, self.stride)
        valid_count = int((views > 0).sum())
        if not valid_count:
            raise InputError("no pixel of the views has depth; give depth images in metres")
        sampling = float32(self.step, self.margin, self.floor)
        sums: Any = _Costs.apply(tsdf, grid, views, view_cameras, sampling)  # type: ignore[no-untyped-call]
        return sums[0] / valid_count, sums[1] / valid_count


def thinned(depth: Tensor, cameras: CameraBatch, stride: int) -> tuple[Tensor, CameraBatch]:
    """Every `stride`-th row and column of images, and the cameras that would take these."""
    if stride == 1:
        return depth, cameras
    small = depth[:, ::stride, ::stride].contiguous()
    height, width = small.shape[1:]
    return small, replace(
        cameras, width=width, height=height, intrinsics=cameras.intrinsics / stride
    )


class _Costs(torch.autograd.Function):
    """Sums of both costs (2,), with the gradient of each, found in the same pass."""

    @staticmethod
    def forward(
        ctx: Any, tsdf: Tensor, grid: GridSpec, depth: Tensor, cameras: CameraBatch, sampling: Any
    ) -> Tensor:
        slots = 1 if depth.is_cuda else _SLOTS
        volume = finite(tsdf, 1.0)
        surface, empty = torch.empty_like(depth), torch.empty_like(depth)
        private = len(depth) * slots
        slopes = volume.new_zeros((private, 2, *grid.shape))
        view_cost.cost(
            depth.numel(), slots, volume.view(-1), depth.view(-1),
            cameras.intrinsics.contiguous(), cameras.T_world_camera.contiguous(),
            surface.view(-1), empty.view(-1), slopes.view(-1),
            (grid.resolution, cameras.width, cameras.height),
            float32(grid.voxel_size, *grid.lower), sampling,
        )  # fmt: skip
        ctx.save_for_backward(slopes.sum(dim=0))
        return torch.stack([surface.double().sum(), empty.double().sum()]).to(tsdf.dtype)

    @staticmethod
    def backward(ctx: Any, *outer: Tensor) -> tuple[Tensor | None, ...]:
        (slopes,) = ctx.saved_tensors
        gradient = outer[0][0] * slopes[0] + outer[0][1] * slopes[1]
        return gradient.to(outer[0].dtype), None, None, None, None
