"""Views of scenes: complete volumes, a depth image and what it says of the grid."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from scenefw.core.protocols import MappingMethod, Noise, Renderer
from scenefw.core.types import (
    Camera,
    CameraBatch,
    GridSpec,
    PartialTSDF,
    SceneParameters,
    SceneVolumes,
)
from scenefw.data.augmentation import RigidAugmentation
from scenefw.kernels.cameras import stack_cameras
from scenefw.representations.volumes import scene_volumes


class Viewpoints(Protocol):
    """Where cameras stand (group `viewpoints`)."""

    def sample(self, rng: np.random.Generator) -> Camera:
        """One random camera."""


@dataclass(frozen=True)
class ViewBatch:
    """B scenes, each seen once.

    Args:
        volumes: the complete scenes, metres.
        depth: (B, H, W) z-depth in metres, 0 = no measurement.
        cameras: one per scene.
        partial: what the depth images say of the grid, metres.
    """

    volumes: SceneVolumes
    depth: Tensor
    cameras: CameraBatch
    partial: PartialTSDF


class ViewMaker:
    """Computes volumes and a random view of each scene, on the device that holds the parameters.

    Args:
        grid: the voxel grid.
        viewpoints: draws cameras.
        renderer: makes depth images of the complete TSDF.
        mapping: fuses them into partial TSDFs.
        noise: disturbs the depth images, applied in the order of the names.
        augmentation: moves whole scenes first; None leaves them where they are.
        image_size: width and height (pixels) to which cameras are resized; None keeps theirs.
    """

    def __init__(
        self,
        grid: GridSpec,
        viewpoints: Viewpoints,
        renderer: Renderer,
        mapping: MappingMethod,
        noise: Mapping[str, Noise] | None = None,
        augmentation: RigidAugmentation | None = None,
        image_size: Sequence[int] | None = None,
    ) -> None:
        self.grid = grid
        self.viewpoints = viewpoints
        self.renderer = renderer
        self.mapping = mapping
        self.noise = dict(noise or {})
        self.augmentation = augmentation
        self.image_size = tuple(image_size) if image_size else None

    def make(
        self,
        parameters: SceneParameters,
        rng: np.random.Generator | Sequence[np.random.Generator],
    ) -> ViewBatch:
        """One view of each of B scenes.

        Args:
            parameters: the scenes.
            rng: one generator per scene, so that a view depends on its own stream alone; or one, of
                which such streams are spawned.
        """
        count = len(parameters.positions)
        streams = rng.spawn(count) if isinstance(rng, np.random.Generator) else list(rng)
        if self.augmentation is not None:
            motions = [self.augmentation.draw(stream) for stream in streams]
            parameters = self.augmentation.apply(parameters, motions)
        device = parameters.positions.device
        cameras = stack_cameras([self._camera(s) for s in streams], device)
        volumes = scene_volumes(parameters, self.grid)
        depth = self._disturb(
            self.renderer.render(volumes.tsdf, self.grid, cameras), cameras, streams
        )
        partial = self.mapping.fuse(depth, self.grid, cameras)
        return ViewBatch(volumes, depth, cameras, partial)

    def _camera(self, stream: np.random.Generator) -> Camera:
        camera = self.viewpoints.sample(stream)
        return camera.resized(*self.image_size) if self.image_size else camera

    def _disturb(
        self, depth: Tensor, cameras: CameraBatch, streams: Sequence[np.random.Generator]
    ) -> Tensor:
        """Noise image by image, as every image has its own stream."""
        if not self.noise:
            return depth
        images = []
        for i, stream in enumerate(streams):
            generator = torch.Generator(depth.device)
            generator.manual_seed(int(stream.integers(2**63 - 1)))
            camera = CameraBatch(
                cameras.width,
                cameras.height,
                cameras.intrinsics[i : i + 1],
                cameras.T_world_camera[i : i + 1],
            )
            image = depth[i : i + 1]
            for name in sorted(self.noise):
                image = self.noise[name].apply(image, camera, generator)
            images.append(image)
        return torch.cat(images)
