"""Sphere tracing of TSDF grids into depth, normals and instance images."""

import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch, SeenSurface
from scenefw.core.errors import InputError
from scenefw.core.protocols import SceneBatch
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.core.types import GridSpec
from scenefw.kernels import rays
from scenefw.kernels.cameras import finite
from scenefw.kernels.compile import float32


class SphereTracer:
    """Renders TSDFs by sphere tracing (Hart 1996; thesis 5.2.1).

    Distances lie at voxel centres and are interpolated trilinearly; beyond the outermost centres
    the field is continued unchanged up to the faces of the cube. Objects which a face cuts are seen
    there as solid. Only the box around negative values is marched through, at no loss.

    Args:
        max_steps: upper bound of steps per ray.
        tolerance: the distance at a hit is refined to less than this (m).
        floor: also hit the plane z = 0, outside the grid too.

    Raises:
        ConfigError: a number out of range.
    """

    def __init__(
        self, max_steps: int = 256, tolerance: float = 1e-4, *, floor: bool = True
    ) -> None:
        COUNT.require(max_steps=max_steps)
        POSITIVE.require(tolerance=tolerance)
        self.max_steps = max_steps
        self.tolerance = tolerance
        self.floor = floor

    def render(self, tsdf: Tensor, grid: GridSpec, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of TSDFs (B, 1, X, Y, Z) in metres; 0 = nothing hit."""
        return self._trace(_flat(tsdf, grid, cameras, "TSDF"), grid, cameras)[0]

    def render_scenes(self, scenes: SceneBatch, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of the volumes of known scenes; 0 = nothing hit."""
        return self.render(scenes.volumes.tsdf, scenes.grid, cameras)

    def render_surface(
        self, tsdf: Tensor, instances: Tensor, grid: GridSpec, cameras: CameraBatch
    ) -> SeenSurface:
        """Depth, normals and instance labels of what the cameras see.

        Args:
            tsdf: (B, 1, X, Y, Z) metres.
            instances: (B, X, Y, Z) integer labels, 0 = no object.
            grid: the voxel grid of both.
            cameras: one per scene.
        """
        volume = _flat(tsdf, grid, cameras, "TSDF")
        labels = _flat(instances, grid, cameras, "instance volume").to(torch.int32)
        depth, kind = self._trace(volume, grid, cameras)
        batch, height, width = depth.shape
        normals = depth.new_empty(batch, 3, height, width)
        visible_labels = torch.empty_like(depth, dtype=torch.int32)
        rays.shade(
            depth.numel(), volume, labels, cameras.intrinsics, cameras.T_world_camera,
            depth.view(-1), kind, normals, visible_labels.view(-1),
            (grid.resolution, width, height), float32(grid.voxel_size, *grid.lower),
        )  # fmt: skip
        return SeenSurface(depth, normals, visible_labels)

    def _trace(self, volume: Tensor, grid: GridSpec, cameras: CameraBatch) -> tuple[Tensor, Tensor]:
        size = (len(cameras.intrinsics), cameras.height, cameras.width)
        depth = torch.empty(size, dtype=torch.float32, device=volume.device)
        kind = torch.empty(depth.numel(), dtype=torch.uint8, device=volume.device)
        rays.trace(
            depth.numel(), volume, _bounds(volume.view(-1, *grid.shape)),
            cameras.intrinsics, cameras.T_world_camera, depth.view(-1), kind,
            (grid.resolution, cameras.width, cameras.height),
            float32(grid.voxel_size, *grid.lower), *float32(self.tolerance),
            self.max_steps, self.floor,
        )  # fmt: skip
        return depth, kind


def _bounds(volume: Tensor) -> Tensor:
    """Boxes (B, 2, 3) in voxels outside which interpolated values of (B, X, Y, Z) are positive.

    A box ends a voxel beyond the outermost values that are not, and at most at the cube's faces.
    Where all are positive its lower end lies above its upper end.
    """
    columns = volume.amin(dim=3)
    lowest = (columns.amin(dim=2), columns.amin(dim=1), volume.amin(dim=(1, 2)))
    solid = torch.stack(lowest, dim=1) <= 0
    number = torch.arange(solid.shape[2], device=volume.device)
    low = torch.where(solid, number, 2 * len(number)).amin(dim=2)
    high = torch.where(solid, number, -2 * len(number)).amax(dim=2)
    return torch.stack(
        [(low - 1.0).clamp(min=-0.5), (high + 1.0).clamp(max=len(number) - 0.5)], dim=1
    )


def _flat(volume: Tensor, grid: GridSpec, cameras: CameraBatch, name: str) -> Tensor:
    batch = len(cameras.intrinsics)
    lead = (batch, 1) if volume.ndim == 5 else (batch,)
    if tuple(volume.shape) != (*lead, *grid.shape):
        raise InputError(
            f"{name} has shape {tuple(volume.shape)}, expected {(*lead, *grid.shape)} for "
            f"{batch} cameras and this grid; give one scene per camera, at the grid's resolution"
        )
    if volume.device != cameras.intrinsics.device:
        raise InputError(
            f"{name} is on {volume.device}, its cameras on {cameras.intrinsics.device}; "
            "move them to one device"
        )
    if volume.is_floating_point():
        return finite(volume, grid.truncation).view(-1)
    return volume.contiguous().view(-1)
