"""Views of scenes: complete volumes, a depth image and what it tells about the grid."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.batches import CameraBatch, PartialTSDF, SceneParameters, SceneVolumes
from scenefw.core.errors import ConfigError
from scenefw.core.protocols import MappingMethod, Noise, PoseNoise, Renderer, SceneBatch
from scenefw.core.rng import Streams
from scenefw.core.types import Camera, Float64, GridSpec
from scenefw.data.augmentation import RigidAugmentation
from scenefw.kernels.cameras import stack_cameras
from scenefw.kernels.transfer import to_device
from scenefw.representations.mesh_volumes import ExactSolids, SolidScenes
from scenefw.representations.volumes import ExactScenes


class Viewpoints(Protocol):
    """Where cameras stand (group `viewpoints`)."""

    camera: Camera

    def sample(self, rng: np.random.Generator) -> Camera:
        """One random camera: `camera` at a random pose."""

    def poses(self, streams: Streams) -> Float64:
        """`T_world_camera` (B, 4, 4) of one random camera per stream."""


@dataclass(frozen=True)
class ViewBatch:
    """B scenes, each seen once.

    Args:
        scenes: as they were seen, moved by the augmentation.
        depth: (B, H, W) z-depth in metres, 0 = no measurement.
        cameras: one per scene.
        partial: what the depth images say of the grid, metres.
    """

    scenes: SceneBatch
    depth: Tensor
    cameras: CameraBatch
    partial: PartialTSDF

    @property
    def volumes(self) -> SceneVolumes:
        """The complete scenes, metres."""
        return self.scenes.volumes


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

    Raises:
        ConfigError: noise of poses, which one view alone doesn't show.
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
        moving = [name for name, one in self.noise.items() if isinstance(one, PoseNoise)]
        if moving:
            raise ConfigError(
                f"views of stacks have exact poses; leave out the pose noise {', '.join(moving)}"
            )
        self.augmentation = augmentation
        self.image_size = tuple(image_size) if image_size else None

    def make(self, parameters: SceneParameters, streams: Streams) -> ViewBatch:
        """One random view of each of B scenes, moved by the augmentation.

        Nothing waits for the device: what is drawn travels there in one copy.

        Args:
            parameters: the scenes.
            streams: one per scene; a view depends on its own alone, whatever the batch.
        """
        to_motion, to_camera, to_noise = streams.split(3)
        lens = self._lens(self.viewpoints.camera)
        intrinsics = np.array([[lens.fx, lens.fy, lens.cx, lens.cy]] * len(streams), np.float32)
        drawn: list[NDArray[Any]] = [
            intrinsics,
            self.viewpoints.poses(to_camera).astype(np.float32),
            np.ascontiguousarray(to_noise.seeds(len(self.noise)).T),
        ]
        if self.augmentation is not None:
            drawn.append(self.augmentation.draw(to_motion).astype(np.float32))
        tensors = to_device(drawn, parameters.positions.device)
        if self.augmentation is not None:
            parameters = self.augmentation.apply(parameters, tensors[3])
        cameras = CameraBatch(lens.width, lens.height, tensors[0], tensors[1])
        return self._see(parameters, cameras, tensors[2])

    def make_one(
        self, parameters: SceneParameters | SolidScenes, rng: np.random.Generator
    ) -> ViewBatch:
        """One random view of one scene where it is stored, without augmentation."""
        device = parameters.positions.device
        cameras = stack_cameras([self._lens(self.viewpoints.sample(rng))], device)
        seeds = rng.integers(2**63 - 1, size=(len(self.noise), 1))
        return self._see(parameters, cameras, torch.from_numpy(seeds).to(device))

    def _lens(self, camera: Camera) -> Camera:
        return camera.resized(*self.image_size) if self.image_size else camera

    def _see(
        self, parameters: SceneParameters | SolidScenes, cameras: CameraBatch, seeds: Tensor
    ) -> ViewBatch:
        """Views with noise of seeds (N, B), one row per noise."""
        scenes = exact_scenes(parameters, self.grid)
        depth = self.renderer.render(scenes.volumes.tsdf, self.grid, cameras)
        for name, row in zip(sorted(self.noise), seeds, strict=True):
            depth = self.noise[name].apply(depth, cameras, row)
        return ViewBatch(scenes, depth, cameras, self.mapping.fuse(depth, self.grid, cameras))


def exact_scenes(parameters: SceneParameters | SolidScenes, grid: GridSpec) -> SceneBatch:
    """Scenes of superquadrics or of meshes, to make volumes of."""
    if isinstance(parameters, SolidScenes):
        return cast("SceneBatch", ExactSolids(parameters, grid))  # without superquadrics
    return ExactScenes(parameters, grid)
