"""What a depth image says, each question asked once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
import torch
from scipy.ndimage import binary_erosion

from scenefw.core.errors import InputError
from scenefw.core.types import Frame
from scenefw.kernels.cameras import camera_of, stack_cameras
from scenefw.perception.observation.floor_noise import FloorNoise
from scenefw.perception.observation.mixed_pixels import mixed_pixels
from scenefw.perception.observation.points import world_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.floors import Floor
    from scenefw.core.protocols import MappingMethod
    from scenefw.core.types import Camera, Float32, Float64, GridSpec, Int32
    from scenefw.perception.observation.workspace import Workspace

    Mask = NDArray[np.bool_]


class ViewGeometry(Protocol):
    """Where surfaces and free space are, as one view says it, or several together."""

    @property
    def points(self) -> Float64:
        """(H, W, 3) world coordinates of the pixels (m), NaN = no depth."""

    @property
    def grid(self) -> GridSpec:
        """Of `free`."""

    @property
    def free(self) -> Mask:
        """(X, Y, Z) voxels that are free, by more than a voxel."""

    @property
    def clear(self) -> Mask:
        """(X, Y, Z) free voxels whose neighbours are free.

        Beside a surface along which the camera looks the next voxel is free already, and may hold
        an object's rounded edge.
        """

    @property
    def eye(self) -> Float64 | None:
        """(3,) where the camera is (m); None of several views."""

    @property
    def mixed(self) -> Mask | None:
        """(H, W) pixels whose depth lies between two surfaces; None: there are none."""


@dataclass(frozen=True, eq=False)
class JointGeometry:
    """One of several views of a scene, with the free space of all; or all at fewer pixels."""

    points: Float64
    grid: GridSpec
    free: Mask
    eye: Float64 | None = None
    mixed: Mask | None = None

    @property
    def cameras(self) -> tuple[ViewGeometry, ...]:
        """Each view by itself: this one."""
        return (self,)

    @cached_property
    def clear(self) -> Mask:
        """(X, Y, Z) free voxels whose neighbours are free."""
        return np.asarray(binary_erosion(self.free))


@dataclass(frozen=True, eq=False)
class Observation:
    """A depth image in the frame of its floor, and what all steps ask of it.

    Args:
        image: floor z = 0, objects around the z axis; depth as methods should see it. None: the
            view came without its image, and only methods of volumes can use it.
        volume: partial TSDF, a batch of one; None: the image was not fused.
        voxels: its grid.
        masks: (H, W) numbers of the objects, 0 = none, where someone has marked them; else None.
        source: the frame as it was read.
        floor: in the coordinates of the camera.
        workspace: which pixels show objects, and how large these are.
        warnings: what looks wrong, one line each.
        measured_noise: of the floor; None: that of this frame.
        ids: what objects 1, 2 ... of the masks are called; empty: as they are numbered.
        turns: how often the image as it was read was turned left by a quarter, so that up is up.
    """

    image: Frame | None
    volume: PartialTSDF | None = None
    voxels: GridSpec | None = None
    masks: Int32 | None = None
    source: Frame | None = None
    floor: Floor | None = None
    workspace: Workspace | None = None
    warnings: tuple[str, ...] = ()
    measured_noise: FloorNoise | None = None
    ids: tuple[int, ...] = ()
    turns: int = 0

    @classmethod
    def of_partial(cls, partial: PartialTSDF, grid: GridSpec) -> Observation:
        """The observation of a view whose floor is known to be z = 0.

        Args:
            partial: a batch of one; without an image it has no pixels.
            grid: its grid.
        """
        if partial.depth is None or partial.cameras is None:
            return cls(None, partial, grid)
        depth = partial.depth[0].cpu().numpy()
        return cls(Frame(depth, camera_of(partial.cameras, 0)), partial, grid)

    def restored(self, depth: Float32, mapping: MappingMethod) -> Observation:
        """The same view with other depth (H, W; m), and the noise that it had."""
        frame = replace(self.frame, depth=depth)
        image = torch.from_numpy(depth)[None].to(self.partial.distance.device)
        cameras = self.partial.cameras or stack_cameras([frame.camera])
        volume = mapping.fuse(image, self.grid, cameras)
        return replace(self, image=frame, volume=volume, measured_noise=self.noise)

    @property
    def frame(self) -> Frame:
        """The image and its camera.

        Raises:
            InputError: the view came without its image.
        """
        if self.image is None:
            raise InputError(
                "this method needs the depth images of partial TSDFs; their mapping left them out"
            )
        return self.image

    @property
    def partial(self) -> PartialTSDF:
        """What the view shows of the grid."""
        if self.volume is None:
            raise InputError("this image was not fused into a partial TSDF")
        return self.volume

    @property
    def grid(self) -> GridSpec:
        """Of volumes."""
        if self.voxels is None:
            raise InputError("this image has no grid of volumes")
        return self.voxels

    @property
    def depth(self) -> Float32:
        """(H, W) metres, 0 = no measurement."""
        return self.frame.depth

    @property
    def camera(self) -> Camera:
        """With its pose above the floor."""
        return self.frame.camera

    @property
    def colour(self) -> NDArray[np.uint8] | None:
        """(H, W, 3) RGB, or None."""
        return self.frame.colour

    @cached_property
    def points(self) -> Float64:
        """(H, W, 3) world coordinates of the pixels (m), NaN = no depth."""
        return world_points(self.frame)

    @property
    def heights(self) -> Float64:
        """(H, W) metres above the floor, NaN = no depth."""
        return self.points[..., 2]

    @property
    def eye(self) -> Float64:
        """(3,) where the camera is (m)."""
        return self.frame.camera.T_world_camera[:3, 3]

    @property
    def cameras(self) -> tuple[ViewGeometry, ...]:
        """Each view by itself: this one; several are `observation.views.Views`."""
        return (self,)

    @cached_property
    def noise(self) -> FloorNoise:
        """Of the floor's heights, as measured before anything was restored."""
        return self.measured_noise or FloorNoise.of(self.heights, self.depth)

    @cached_property
    def mixed(self) -> Mask:
        """(H, W) pixels whose depth lies between two surfaces."""
        if not self.noise.is_correlated:  # no windows were matched
            return np.zeros(self.depth.shape, dtype=bool)
        return mixed_pixels(self.points, self.eye)

    @cached_property
    def free(self) -> Mask:
        """(X, Y, Z) voxels that the view shows to be free, by more than a voxel."""
        partial = self.partial
        free = partial.observed & (partial.distance > self.grid.voxel_size)
        return np.asarray(free[0, 0].cpu().numpy())

    @cached_property
    def clear(self) -> Mask:
        """(X, Y, Z) free voxels whose neighbours are free."""
        return np.asarray(binary_erosion(self.free))
