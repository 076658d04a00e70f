"""Views of scenes: complete volumes, a depth image and what it tells about the grid."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.batches import CameraBatch, PartialTSDF, SceneParameters, SceneVolumes
from scenefw.core.errors import InputError
from scenefw.core.protocols import MappingMethod, Noise, Renderer, SceneBatch
from scenefw.core.rng import Streams
from scenefw.core.training_protocols import Augmentation
from scenefw.core.types import Camera, Float64, GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw.kernels.transfer import to_device
from scenefw.noise.frames import depth_noises
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
    """B scenes, each seen once, or fused from several views.

    Args:
        scenes: as they were seen, moved by the augmentation.
        depth: (B, H, W) z-depth in metres, 0 = no measurement; of each scene's first view.
        cameras: one per scene, of the first view.
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

    @property
    def superquadrics(self) -> SceneParameters:
        """The objects of the scenes.

        Raises:
            InputError: they are meshes.
        """
        if not isinstance(self.scenes, ExactScenes):
            raise InputError(
                f"views of {type(self.scenes).__name__} show no superquadrics; give scenes of "
                "run=generate scene=stacks"
            )
        return self.scenes.parameters


class ViewMaker:
    """Computes volumes and a random view of each scene, on the device that holds the parameters.

    Args:
        grid: the voxel grid.
        viewpoints: draws cameras.
        renderer: makes depth images of the complete scenes.
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
        augmentation: Augmentation | None = None,
        image_size: Sequence[int] | None = None,
    ) -> None:
        self.grid = grid
        self.viewpoints = viewpoints
        self.renderer = renderer
        self.mapping = mapping
        self.noise = depth_noises(noise, "views of stacks")
        self.augmentation = augmentation
        self.image_size = tuple(image_size) if image_size else None

    def make(
        self,
        parameters: SceneParameters,
        streams: Streams,
        counts: NDArray[np.integer] | None = None,
    ) -> ViewBatch:
        """Random views of B scenes, moved by the augmentation.

        Nothing waits for the device: what is drawn travels there in one copy per view.

        Args:
            parameters: the scenes.
            streams: one per scene; its views depend on its own alone, whatever the batch.
            counts: (B,) views of each scene, fused into one partial TSDF; None means one each.
        """
        to_motion, to_camera, to_noise, to_cameras, to_noises = streams.split(5)
        arrays = self._draw_views(to_camera, to_noise)
        if self.augmentation is not None:
            arrays.append(self.augmentation.draw(to_motion).astype(np.float32))
        device = parameters.positions.device
        tensors = to_device(arrays, device)
        if self.augmentation is not None:
            parameters = self.augmentation.apply(parameters, tensors[3])
        views = self._see(parameters, self._cameras(tensors), tensors[2])
        if counts is None:
            return views
        for number in range(1, int(counts.max(initial=1))):
            rows = np.flatnonzero(counts > number)
            view_streams = [
                Streams(to.split(number)[-1].keys[rows]) for to in (to_cameras, to_noises)
            ]
            tensors = to_device([rows, *self._draw_views(*view_streams)], device)
            views = self._seen_again(views, tensors[0], self._cameras(tensors[1:]), tensors[3])
        return views

    def _draw_views(self, to_camera: Streams, to_noise: Streams) -> list[NDArray[Any]]:
        """Intrinsics (B, 4), poses (B, 4, 4) and seeds of noise (N, B) of one view of each."""
        lens = self._lens(self.viewpoints.camera)
        return [
            np.array([[lens.fx, lens.fy, lens.cx, lens.cy]] * len(to_camera), np.float32),
            self.viewpoints.poses(to_camera).astype(np.float32),
            np.ascontiguousarray(to_noise.seeds(len(self.noise)).T),
        ]

    def _cameras(self, tensors: Sequence[Tensor]) -> CameraBatch:
        lens = self._lens(self.viewpoints.camera)
        return CameraBatch(lens.width, lens.height, tensors[0], tensors[1])

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
        depth = self._depth(scenes, cameras, seeds)
        return ViewBatch(scenes, depth, cameras, self.mapping.fuse(depth, self.grid, cameras))

    def _seen_again(
        self, views: ViewBatch, rows: Tensor, cameras: CameraBatch, seeds: Tensor
    ) -> ViewBatch:
        """The same scenes, of which those in `rows` have a further view."""
        depth = self._depth(views.scenes.chosen(rows), cameras, seeds)
        partial = self.mapping.fuse(depth, self.grid, cameras)
        previous = views.partial
        union = PartialTSDF(previous.distance[rows], previous.observed[rows]).merge(partial)
        distance = previous.distance.index_copy(0, rows, union.distance)
        observed = previous.observed.index_copy(0, rows, union.observed)
        return replace(views, partial=PartialTSDF(distance, observed))

    def _depth(self, scenes: SceneBatch, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        depth = self.renderer.render_scenes(scenes, cameras)
        for noise_model, row in zip(self.noise.values(), seeds, strict=True):
            depth = noise_model.apply(depth, cameras, row)
        return depth


def exact_scenes(parameters: SceneParameters | SolidScenes, grid: GridSpec) -> SceneBatch:
    """Scenes of superquadrics or of meshes, to make volumes of."""
    if isinstance(parameters, SolidScenes):
        return ExactSolids(parameters, grid)
    return ExactScenes(parameters, grid)
