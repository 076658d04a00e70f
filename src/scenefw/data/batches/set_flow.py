"""The data module of flows of sets: seen points of each object, made on the device that trains."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch, IndexBatch, SceneParameters
from scenefw.core.set_flows import SetFlowBatch
from scenefw.core.settings import COUNT, NOT_NEGATIVE
from scenefw.core.types import GridSpec
from scenefw.data.batches.object_ends import object_ends
from scenefw.data.batches.ray_images import ray_images
from scenefw.data.batches.scene_batches import SceneBatches
from scenefw.data.batches.stacks import StackScenes
from scenefw.data.batches.view_frames import in_frame
from scenefw.data.batches.view_samples import ObjectSamples
from scenefw.data.batches.views import Viewpoints
from scenefw.kernels.cameras import pixel_places, places_of
from scenefw.kernels.transfer import to_device
from scenefw.noise.frames import depth_noises, described

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from scenefw.core.protocols import Noise

# Random streams, beside that of the order of scenes
_VIEWS, _VALIDATION = 2, 3


class SetFlowViews(SceneBatches):
    """Views of superquadrics of two splits, as points of what is seen of each (group `dataset`).

    Objects meet rays directly: no volume and no image is kept. Camera, size and noise of scene i in
    epoch e depend on (seed, e, i) alone. Further arguments are those of
    `SceneBatches`.

    Args:
        viewpoints: draws cameras.
        image_size: width and height (pixels) of the images that say what is seen.
        points: of each object, drawn from its pixels.
        ends: of the image of each object, drawn from the pixels beside which something else is.
        least: pixels of an object that is seen.
        noise: disturbs the images as depth cameras do, applied in the order of the names.
        along: standard deviation of points and ends along their ray (m), at most: views differ.
        scale: scenes become up to this factor larger or smaller; a pile still stands then.

    Raises:
        ConfigError: a number that isn't positive, or a factor below one.
    """

    def __init__(
        self,
        viewpoints: Viewpoints,
        path: str | Sequence[str] | None = None,
        limit: int | None = None,
        validation_limit: int | None = 64,
        batch_size: int = 64,
        seed: int = 0,
        distinct_batches: int | None = None,
        image_size: Sequence[int] = (ObjectSamples.width, 96),
        points: int = ObjectSamples.points,
        ends: int = ObjectSamples.ends,
        least: int = 1,
        noise: Mapping[str, Noise] | None = None,
        along: float = 0.0015,
        scale: float = 1.15,
    ) -> None:
        super().__init__(path, limit, validation_limit, batch_size, seed, distinct_batches)
        COUNT.require(image_size=image_size, points=points, ends=ends, least=least, scale=scale)
        NOT_NEGATIVE.require(along=along)
        self.viewpoints = viewpoints
        self.lens = viewpoints.camera.resized(*image_size)
        self.points, self.ends, self.least = points, ends, least
        self.noise = depth_noises(noise, "sets of seen objects")
        self.along, self.scale = along, scale
        self.grid: GridSpec | None = None

    @property
    def noise_words(self) -> str | list[str]:
        """What disturbs the views."""
        return [*described(self.noise), f"up to {self.along} m along rays"]

    def facts(self) -> dict[str, Any]:
        """Facts about the data, and what networks are shown of each object."""
        samples = ObjectSamples(self.points, self.ends, self.lens.width)
        return {**super().facts(), **samples.facts()}

    def training_batch(self, batch: IndexBatch, device: torch.device) -> SetFlowBatch:
        """Views of scenes in an epoch, scaled and half of them mirrored."""
        return self._make(self.scenes, batch, device, _VIEWS, changed=True)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> SetFlowBatch:
        """The same views every time, of scenes as they are."""
        return self._make(self.validation_scenes, batch, device, _VALIDATION, changed=False)

    def views_of(self, scenes: StackScenes, rows: Sequence[int]) -> SetFlowBatch:
        """A view of each scene of another split, as of validation, on the CPU."""
        batch = IndexBatch(0, torch.tensor(list(rows), dtype=torch.int64))
        return self._make(scenes, batch, torch.device("cpu"), _VALIDATION, changed=False)

    @torch.no_grad()
    def _make(
        self,
        scenes: StackScenes,
        batch: IndexBatch,
        device: torch.device,
        stream: int,
        *,
        changed: bool,
    ) -> SetFlowBatch:
        parameters = scenes.parameters(batch.indices, device)
        streams = self.streams(batch, stream)
        to_camera, to_change, to_points, to_ends, to_noise = streams.split(5)
        change = to_change.uniform(3) if changed else np.full((len(streams), 3), 0.5)
        scale = self.scale ** (2 * change[:, :1] - 1)
        slots = parameters.present.shape[1]
        arrays: list[NDArray[Any]] = [
            np.array([_intrinsics(self.lens)] * len(streams), np.float32),
            self.viewpoints.poses(to_camera).astype(np.float32),
            scale.astype(np.float32),
            (change[:, 1] < 0.5).astype(np.float32),
            (self.along * change[:, 2:]).astype(np.float32),
            to_points.uniform(3 * slots * self.points).astype(np.float32),
            to_ends.uniform(3 * slots * self.ends).astype(np.float32),
            np.ascontiguousarray(to_noise.seeds(len(self.noise)).T),
        ]
        intrinsics, poses, factors, mirrored, sigmas, *random, seeds = to_device(arrays, device)
        cameras = CameraBatch(self.lens.width, self.lens.height, intrinsics, poses)
        parameters = _scaled(parameters, factors)
        depth, owners = ray_images(parameters, cameras, self.noise, seeds)
        views = self._view_batch(parameters, cameras, depth, owners, sigmas, *random)
        return _mirrored(views, mirrored > 0)

    def _view_batch(
        self,
        scenes: SceneParameters,
        cameras: CameraBatch,
        depth: Tensor,
        owners: Tensor,
        sigmas: Tensor,
        random: Tensor,
        at_ends: Tensor,
    ) -> SetFlowBatch:
        batch, slots = scenes.present.shape
        flat = owners.flatten(1).long()
        counts = torch.zeros(batch, slots + 1, dtype=torch.int64, device=flat.device)
        counts.scatter_add_(1, flat, torch.ones_like(flat))
        order = flat.argsort(dim=1, stable=True)
        starts = counts.cumsum(dim=1) - counts
        chances = random.view(batch, 3, slots, self.points)
        pixel_counts = counts[:, 1:, None]
        places = starts[:, 1:, None] + (chances[:, 0] * pixel_counts).long().minimum(
            (pixel_counts - 1).clamp_min(0)
        )
        pixels = order.gather(1, places.clamp_max(flat.shape[1] - 1).flatten(1))
        noise = sigmas * _normal(chances[:, 1], chances[:, 2]).flatten(1)
        points = places_of(depth.flatten(1).gather(1, pixels) + noise, pixels, cameras)
        visible = counts[:, 1:] >= self.least
        points = points.view(batch, slots, self.points, 3)
        return in_frame(
            torch.where(visible[..., None, None], points, 0.0),
            visible,
            counts[:, 1:] / flat.shape[1],
            self._ends(depth, owners, cameras, sigmas, at_ends.view(batch, 3, slots, self.ends)),
            cameras.T_world_camera[:, :3, 3],
            scenes,
        )

    def _ends(
        self, depth: Tensor, owners: Tensor, cameras: CameraBatch, sigmas: Tensor, chances: Tensor
    ) -> Tensor:
        """Where images of objects end, with noise along the rays."""
        eye = cameras.T_world_camera[:, :3, 3]
        points = torch.where(depth.isnan()[..., None], torch.nan, pixel_places(depth, cameras))
        ends = object_ends(points, owners, eye, chances[:, 0])
        noise = sigmas[..., None] * _normal(chances[:, 1], chances[:, 2])
        ray = torch.nn.functional.normalize(ends[..., :3] - eye[:, None, None], dim=-1)
        shift = torch.cat(
            [noise[..., None] * ray, torch.zeros_like(ray), -noise[..., None]], dim=-1
        )
        return torch.where(ends.any(dim=-1, keepdim=True), ends + shift, 0.0)


def _scaled(scenes: SceneParameters, factors: Tensor) -> SceneParameters:
    """Scenes (B) times factors (B, 1), about the origin on the floor."""
    by = factors[:, :, None]
    return replace(scenes, half_axes=scenes.half_axes * by, positions=scenes.positions * by)


def _intrinsics(lens: Any) -> list[float]:
    return [lens.fx, lens.fy, lens.cx, lens.cy]


def _normal(first: Tensor, second: Tensor) -> Tensor:
    """Standard normal numbers of two uniform ones (Box and Muller 1958)."""
    return (-2 * (1 - first).clamp_min(1e-7).log()).sqrt() * (2 * torch.pi * second).cos()


def _mirrored(batch: SetFlowBatch, mask: Tensor) -> SetFlowBatch:
    """Some views seen in a mirror: y becomes -y. Superquadrics are their own mirror images."""
    sign = torch.where(mask, -1.0, 1.0)
    flip = torch.stack([torch.ones_like(sign), sign, torch.ones_like(sign)], dim=-1)
    rotations = batch.rotations * flip[:, None, :, None] * sign[:, None, None, None]
    end_flip = torch.cat([flip, flip, torch.ones_like(sign)[:, None]], dim=-1)
    return replace(
        batch,
        points=batch.points * flip[:, None, None],
        ends=batch.ends * end_flip[:, None, None],
        camera=batch.camera * flip,
        rotations=rotations,
        positions=batch.positions * flip[:, None],
    )
