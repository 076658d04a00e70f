"""The data module of decoders of sets that see images: small depth images by rays, no volume."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from scenefw.core.batches import CameraBatch
from scenefw.core.queried_sets import IMAGE, ObjectQueryBatch
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.data.batches.moved_scenes import in_frames, mirrored, scaled
from scenefw.data.batches.places_about import CHANCES, placed_about, require_places
from scenefw.data.batches.ray_images import ray_images
from scenefw.data.batches.scene_batches import SceneBatches
from scenefw.data.batches.set_inputs import image_shape, view_of_places
from scenefw.data.batches.view_samples import WIDTH_OF_VIEW, image_facts
from scenefw.kernels.cameras import pixel_places
from scenefw.kernels.transfer import to_device
from scenefw.noise.frames import depth_noises, described

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from scenefw.core.batches import IndexBatch
    from scenefw.core.protocols import Noise
    from scenefw.core.types import GridSpec
    from scenefw.data.batches.stacks import StackScenes
    from scenefw.data.batches.views import Viewpoints

# Random streams, beside that of the order of scenes
_VIEWS, _VALIDATION = 2, 3


class ImageQueryViews(SceneBatches):
    """Images of the scenes of two splits, in the frames of their views (group `dataset`).

    Camera, size and noise of scene i in epoch e depend on (seed, e, i) alone.

    Args:
        viewpoints: draws cameras.
        grid: outside which nothing is seen.
        path: the `.npz` of a data set, the name of a shipped one, or several.
        limit: at most this many training scenes; None means all.
        validation_limit: at most this many validation scenes; None means all.
        batch_size: scenes per step.
        seed: seed of the order of scenes, and of views.
        distinct_batches: train on this many batches again and again, views and all; None means all.
        width: pixels along images; both sides are rounded to multiples of 32 (`image_shape`).
        places: about each object, at which distances are learnt; half of them near its surface.
        near: how near (m, standard deviation).
        noise: disturbs the images as depth cameras do, applied in the order of the names.
        scale: training scenes become up to this factor larger or smaller.

    Raises:
        ConfigError: a number that isn't positive, an odd number of places, or a factor below one.
    """

    sees = IMAGE

    def __init__(
        self,
        viewpoints: Viewpoints,
        grid: GridSpec,
        path: str | Sequence[str] | None = None,
        limit: int | None = None,
        validation_limit: int | None = 64,
        batch_size: int = 32,
        seed: int = 0,
        distinct_batches: int | None = None,
        width: int = WIDTH_OF_VIEW,
        places: int = 128,
        near: float = 0.01,
        noise: Mapping[str, Noise] | None = None,
        scale: float = 1.15,
    ) -> None:
        super().__init__(path, limit, validation_limit, batch_size, seed, distinct_batches)
        COUNT.require(width=width, scale=scale)
        POSITIVE.require(near=near)
        require_places(places)
        self.viewpoints, self.grid = viewpoints, grid
        camera = viewpoints.camera
        rows, columns = image_shape(width, camera.width, camera.height)
        self.lens = camera.resized(columns, rows)
        self.places, self.near, self.scale = places, near, scale
        self.noise = depth_noises(noise, "images of sets")

    @property
    def noise_words(self) -> str | list[str]:
        """What disturbs the views."""
        return described(self.noise)

    def facts(self) -> dict[str, Any]:
        """Facts about the data, and how wide images are."""
        return {**super().facts(), **image_facts(self.lens.width)}

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ObjectQueryBatch:
        """Views and objects of scenes in an epoch, scaled and half of them mirrored."""
        return self._make(self.scenes, batch, device, _VIEWS, changed=True)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ObjectQueryBatch:
        """The same views every time, of scenes as they are."""
        return self._make(self.validation_scenes, batch, device, _VALIDATION, changed=False)

    @torch.no_grad()
    def _make(
        self,
        scenes: StackScenes,
        batch: IndexBatch,
        device: torch.device,
        stream: int,
        *,
        changed: bool,
    ) -> ObjectQueryBatch:
        parameters = scenes.parameters(batch.indices, device)
        streams = self.streams(batch, stream)
        to_camera, to_change, to_places, to_noise = streams.split(4)
        change = to_change.uniform(2) if changed else np.full((len(streams), 2), 0.5)
        slots = parameters.present.shape[1]
        lens = self.lens
        arrays: list[NDArray[Any]] = [
            np.array([[lens.fx, lens.fy, lens.cx, lens.cy]] * len(streams), np.float32),
            self.viewpoints.poses(to_camera).astype(np.float32),
            (self.scale ** (2 * change[:, :1] - 1)).astype(np.float32),
            (change[:, 1] < 0.5).astype(np.float32),
            to_places.uniform(slots * self.places * CHANCES).astype(np.float32),
            np.ascontiguousarray(to_noise.seeds(len(self.noise)).T),
        ]
        intrinsics, poses, factors, flipped, at_places, seeds = to_device(arrays, device)
        cameras = CameraBatch(lens.width, lens.height, intrinsics, poses)
        parameters = mirrored(scaled(parameters, factors), flipped > 0)
        depth, _ = ray_images(parameters, cameras, self.noise, seeds)
        places = torch.where(depth.isnan()[..., None], torch.nan, pixel_places(depth, cameras))
        view = view_of_places(places, self.grid, poses)
        objects = in_frames(parameters, view.turn, view.origin)
        chances = at_places.view(len(poses), slots, self.places, CHANCES)
        about, distances = placed_about(objects, chances, self.near)
        return ObjectQueryBatch(view.condition, view.points, view.seen, objects, about, distances)
