"""The data module of depth images and which object each pixel shows, made where it trains."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch, IndexBatch, SceneParameters
from scenefw.core.errors import SettingError
from scenefw.core.part_views import PartViewBatch
from scenefw.core.rng import Streams
from scenefw.core.settings import COUNT, NOT_NEGATIVE, SHARE
from scenefw.data.batches.compounds import compounds
from scenefw.data.batches.floor_motions import floor_motions
from scenefw.data.batches.scene_batches import SceneBatches
from scenefw.data.batches.surroundings import surrounding_depths
from scenefw.kernels.superquadric_rays import first_hits
from scenefw.kernels.transfer import to_device
from scenefw.noise.frames import depth_noises, described
from scenefw.representations.volumes import scene_volumes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from scenefw.core.protocols import Noise, SurfaceRenderer
    from scenefw.core.types import GridSpec
    from scenefw.data.batches.views import Viewpoints

# Random streams, beside that of the order of scenes
_VIEWS, _VALIDATION = 2, 3
_SAME = 0.008  # m between exact and traced depth of one surface
_FARTHEST = 4.0  # m


class PartViews(SceneBatches):
    """Depth images of superquadrics on the floor, and the owner of each pixel (group `dataset`).

    Part of the images are exact, by rays that meet the superquadrics; the others are traced through
    their TSDF, as images of evaluations are, and have its rounded edges. In part of the exact ones
    objects are cups, or have a second piece, and in part the floor is a table that ends. The pose
    that goes with an image is a little off, as one found by RANSAC is. Camera, size, changes and
    noise of scene i in epoch e depend on (seed, e, i) alone. Further arguments are those of
    `SceneBatches`.

    Args:
        viewpoints: draws cameras.
        renderer: makes images of TSDFs.
        grid: of these TSDFs.
        image_size: width and height (pixels).
        noise: disturbs the images, applied in the order of the names.
        traced: share of the images that are traced through TSDFs.
        compound: share of the exact images in which objects are changed.
        hollow: share of their objects that are cups.
        pieces: share of their objects with a second piece.
        ends: share of the exact images in which the floor is a table that ends.
        tilt: standard deviation of the found floor's slope (degrees), along x and y each.
        lift: the same of its height (m).
        scale: least and greatest factor by which scenes become smaller or larger.

    Raises:
        ConfigError: a size or factor that isn't positive, a share outside 0..1, a negative
            deviation, a least factor above the greatest, or noise of poses.
    """

    def __init__(
        self,
        viewpoints: Viewpoints,
        renderer: SurfaceRenderer,
        grid: GridSpec,
        path: str | Sequence[str] | None = None,
        limit: int | None = None,
        validation_limit: int | None = 64,
        batch_size: int = 8,
        seed: int = 0,
        distinct_batches: int | None = None,
        image_size: Sequence[int] = (320, 240),
        noise: Mapping[str, Noise] | None = None,
        traced: float = 0.4,
        compound: float = 0.5,
        hollow: float = 0.35,
        pieces: float = 0.35,
        ends: float = 0.5,
        tilt: float = 0.4,
        lift: float = 0.003,
        scale: Sequence[float] = (0.5, 1.3),
    ) -> None:
        super().__init__(path, limit, validation_limit, batch_size, seed, distinct_batches)
        SHARE.require(traced=traced, compound=compound, hollow=hollow, pieces=pieces, ends=ends)
        NOT_NEGATIVE.require(tilt=tilt, lift=lift)
        COUNT.require(image_size=image_size)
        if len(scale) != 2 or not 0 < scale[0] <= scale[1]:
            raise SettingError("scale", scale, "two factors above 0, the smaller first")
        self.viewpoints, self.renderer, self.volumes = viewpoints, renderer, grid
        self.lens = viewpoints.camera.resized(*image_size)
        self.image_size = (self.lens.width, self.lens.height)
        self.noise = depth_noises(noise, "views of stacks")
        self.scale = (float(scale[0]), float(scale[1]))
        self.traced, self.compound = traced, compound
        self.hollow, self.pieces, self.ends = hollow, pieces, ends
        self.tilt, self.lift = tilt, lift
        self.grid: GridSpec | None = None

    @property
    def noise_words(self) -> str | list[str]:
        """What disturbs the images."""
        return described(self.noise)

    def training_batch(self, batch: IndexBatch, device: torch.device) -> PartViewBatch:
        """Images of scenes in an epoch, larger or smaller ones."""
        return self._make(self.scenes.parameters(batch.indices, device), batch, _VIEWS, self.scale)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> PartViewBatch:
        """The same images every time, of scenes as they are."""
        scenes = self.validation_scenes.parameters(batch.indices, device)
        return self._make(scenes, batch, _VALIDATION, (1.0, 1.0))

    @torch.no_grad()
    def _make(
        self, scenes: SceneParameters, batch: IndexBatch, stream: int, scale: tuple[float, float]
    ) -> PartViewBatch:
        streams = self.streams(batch, stream)
        to_camera, to_scale, to_noise, to_change, to_end, to_floor = streams.split(6)
        chances = to_scale.uniform(4)
        minimum, maximum = scale
        lens = self.lens
        arrays: list[NDArray[Any]] = [
            np.array([[lens.fx, lens.fy, lens.cx, lens.cy]] * len(streams), np.float32),
            self.viewpoints.poses(to_camera).astype(np.float32),
            (minimum * (maximum / minimum) ** chances[:, :1, None]).astype(np.float32),
            np.ascontiguousarray(to_noise.seeds(len(self.noise)).T),
            floor_motions(to_floor, self.tilt, self.lift),
        ]
        intrinsics, poses, factors, seeds, motions = to_device(arrays, scenes.positions.device)
        cameras = CameraBatch(*self.image_size, intrinsics, poses)
        scenes = replace(
            scenes, half_axes=scenes.half_axes * factors, positions=scenes.positions * factors
        )
        traced = chances[:, 1] < self.traced
        changed = ~traced & (chances[:, 2] < self.compound)
        depth, owners = self._exact(scenes, cameras, changed, to_change)
        around = surrounding_depths(scenes, cameras, to_end, ~traced & (chances[:, 3] < self.ends))
        owners = torch.where(depth < around, owners, 0)
        depth = torch.where(owners > 0, depth, torch.where(around < _FARTHEST, around, 0.0))
        depth, owners = self._traced(scenes, cameras, traced, depth, owners)
        for noise_model, row in zip(self.noise.values(), seeds, strict=True):
            depth = noise_model.apply(depth, cameras, row)
        cameras = CameraBatch(*self.image_size, intrinsics, motions @ poses)
        return PartViewBatch(depth, owners, cameras)

    def _traced(
        self,
        scenes: SceneParameters,
        cameras: CameraBatch,
        traced: NDArray[np.bool_],
        exact: Tensor,
        owners: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Depth with the floor, and owners of pixels, some of them (B,) through TSDFs."""
        rows = torch.from_numpy(np.flatnonzero(traced)).to(exact.device)
        if not len(rows):
            return exact, owners
        subset = SceneParameters(*(getattr(scenes, name)[rows] for name in vars(scenes)))
        rendering = self._trace(subset, cameras.of(rows))
        same_surface = (rendering[0] - exact[rows]).abs() < _SAME
        whose = torch.where(same_surface, owners[rows], rendering[1])
        return exact.index_copy(0, rows, rendering[0]), owners.index_copy(0, rows, whose)

    def _exact(
        self,
        scenes: SceneParameters,
        cameras: CameraBatch,
        changed: NDArray[np.bool_],
        to_change: Streams,
    ) -> tuple[Tensor, Tensor]:
        """Depth and owners by rays that meet superquadrics, without the floor."""
        if not changed.any():
            return first_hits(scenes, cameras)
        pieces, holes = compounds(scenes, to_change, changed, self.hollow, self.pieces)
        depth, owners = first_hits(pieces, cameras, holes)
        slots = scenes.present.shape[1]
        return depth, torch.where(owners > slots, owners - slots, owners)

    def _trace(self, scenes: SceneParameters, cameras: CameraBatch) -> tuple[Tensor, Tensor]:
        """Depth through TSDFs, and the objects that its voxels are of."""
        exact_volumes = scene_volumes(scenes, self.volumes)
        surface = self.renderer.render_surface(
            exact_volumes.tsdf, exact_volumes.instances, self.volumes, cameras
        )
        depth = torch.where(surface.depth < _FARTHEST, surface.depth, 0.0)
        return depth, surface.instances.clamp_min(0)
