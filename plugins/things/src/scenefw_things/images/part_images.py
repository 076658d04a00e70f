"""The data module of stored images with colour and obstacles, beside views of superquadrics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import lightning
import numpy as np
import torch

from scenefw.core.batches import CameraBatch, IndexBatch
from scenefw.core.errors import ConfigError, SettingError
from scenefw.core.part_views import PartViewBatch
from scenefw.core.rng import Streams
from scenefw.core.settings import COUNT
from scenefw.data.epochs import EpochBatches
from scenefw_things.images.changes import ImageChanges
from scenefw_things.images.stored_images import StoredImages
from scenefw_things.images.texture_mixing import TextureMixing

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from scenefw.core.types import GridSpec
    from scenefw.data.batches.part_views import PartViews

_CHANGES, _VALIDATION, _WINDOWS, _TEXTURES = 4, 5, 6, 7  # random streams, beside those of the views


class PartImages(lightning.LightningDataModule):
    """Images of things with all that is no thing, and views of superquadrics (group `dataset`).

    Stored images come first in an epoch's numbers, then views, so each kind has the share of its
    number. An image is used again and again with other noise, in a mirror, nearer or farther, and
    in other light; of part of them colours are left out, as depth cameras without have none. Views
    get a colour for each object, and half of all images colours of another image over theirs.
    What image i becomes in epoch e depends on (seed, e, i) alone.

    Args:
        views: of superquadrics, whose noise and errors of the floor stored images get too.
        folder: with `train` and `val`, each of `StoredImages`.
        colourless: chance that an image has no colours.
        brightness: most by which exposure changes, as a power of two; gamma and the light's colour
            change by half of it.
        mixing: most that colours of another image weigh.
        scale: most by which scenes become larger or smaller, as a power of two.
        validation_limit: at most this many stored validation images; None means all.
        crop: width and height (pixels) of a window into which the images of a training batch are
            cut, another one in each batch; None: they stay whole. Local geometry fits into it, and
            a core makes several times as many.

    Raises:
        ConfigError: a chance outside 0..1, images of another size than the views, or a window
            larger than they are.
        StorageError: there are no images.
    """

    grid: GridSpec | None = None

    def __init__(
        self,
        views: PartViews,
        folder: str | Path,
        colourless: float,
        brightness: float,
        mixing: float,
        scale: float,
        validation_limit: int | None = None,
        crop: Sequence[int] | None = None,
    ) -> None:
        super().__init__()
        COUNT.require(validation_limit=validation_limit)
        self.views, self.folder = views, folder
        self.changes = ImageChanges(
            views.noise, colourless, brightness, scale, views.tilt, views.lift
        )
        self.images = StoredImages.open(f"{folder}/train")
        self.validation_images = StoredImages.open(f"{folder}/val")
        self.validation_limit = len(self.validation_images)
        if validation_limit is not None:
            self.validation_limit = min(validation_limit, self.validation_limit)
        self.mixing = TextureMixing(self.images, mixing)
        self.image_size, self.batch_size = views.image_size, views.batch_size
        self.crop = _window_size(crop, self.image_size)
        sizes = {self.images.size, self.validation_images.size, self.image_size}
        if len(sizes) != 1:
            raise ConfigError(
                f"{folder} holds images of {self.images.size}, the views have {self.image_size} "
                "pixels; give dataset.views.image_size"
            )

    def facts(self) -> dict[str, Any]:
        """Facts about the training data."""
        things = {k: v for k, v in self.images.facts.items() if k not in ("count", "size")}
        return {**self.views.facts(), "things": things, "images": len(self.images)}

    def train_dataloader(self) -> EpochBatches:
        """Shuffled batches."""
        count = len(self.images) + len(self.views.scenes)
        return EpochBatches(count, self.batch_size, self.views.seed)

    def val_dataloader(self) -> EpochBatches:
        """The same batches every time: stored images, then views."""
        count = self.validation_limit + len(self.views.validation_scenes)
        return EpochBatches(count, self.batch_size, None)

    def training_batch(self, batch: IndexBatch, device: torch.device) -> PartViewBatch:
        """Images of an epoch, each a function of only (seed, epoch, index)."""
        stored, views = _divided(batch, len(self.images))
        parts = []
        if len(stored.indices):
            images = self._changed(self.images, stored, _CHANGES, device)
            parts.append(self._textured(images, stored, 0))
        if len(views.indices):
            images = self.views.training_batch(views, device)
            parts.append(self._textured(images, views, len(self.images)))
        return self._cut(_joined(parts), batch)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> PartViewBatch:
        """The same images in every epoch."""
        stored, views = _divided(IndexBatch(0, batch.indices), self.validation_limit)
        parts = []
        if len(stored.indices):
            parts.append(self._changed(self.validation_images, stored, _VALIDATION, device))
        if len(views.indices):
            parts.append(self.views.validation_batch(views, device))
        return _joined(parts)

    def _textured(self, images: PartViewBatch, batch: IndexBatch, first: int) -> PartViewBatch:
        numbers = (batch.indices + first).numpy()
        streams = Streams.of(self.views.seed, _TEXTURES, batch.epoch, indices=numbers)
        colour = self.mixing.apply(images, streams, self.changes.colourless)
        return replace(images, colour=colour)

    def _cut(self, whole: PartViewBatch, batch: IndexBatch) -> PartViewBatch:
        """The images in a window that follows from the first one's number."""
        (width, height), (full_width, full_height) = self.crop, self.image_size
        first = Streams.of(self.views.seed, _WINDOWS, batch.epoch, indices=batch.indices[:1])
        free_sides = np.array([full_width - width + 1, full_height - height + 1])
        left, top = (first.uniform(2)[0] * free_sides).astype(int).tolist()
        window = (..., slice(top, top + height), slice(left, left + width))
        cameras = whole.cameras
        shift = torch.tensor([0.0, 0.0, left, top], device=cameras.intrinsics.device)
        return PartViewBatch(
            whole.depth[window],
            whole.owners[window],
            CameraBatch(width, height, cameras.intrinsics - shift, cameras.T_world_camera),
            None if whole.obstacles is None else whole.obstacles[window],
            None if whole.colour is None else whole.colour[window],
        )

    def _changed(
        self, images: StoredImages, batch: IndexBatch, stream: int, device: torch.device
    ) -> PartViewBatch:
        rows = batch.indices.numpy()
        streams = Streams.of(self.views.seed, stream, batch.epoch, indices=rows)
        return self.changes.apply(images, rows, streams, device)


def _window_size(crop: Sequence[int] | None, image_size: tuple[int, int]) -> tuple[int, int]:
    if crop is None:
        return image_size
    if len(crop) != 2 or not all(1 <= a <= b for a, b in zip(crop, image_size, strict=True)):
        raise SettingError("crop", list(crop), f"width and height up to {image_size}")
    return int(crop[0]), int(crop[1])


def _divided(batch: IndexBatch, images: int) -> tuple[IndexBatch, IndexBatch]:
    """Numbers of stored images, and those of views."""
    is_stored = batch.indices < images
    return (
        IndexBatch(batch.epoch, batch.indices[is_stored]),
        IndexBatch(batch.epoch, batch.indices[~is_stored] - images),
    )


def _joined(parts: list[PartViewBatch]) -> PartViewBatch:
    """Images of several batches as one; those without colour have NaN."""
    if len(parts) == 1:
        return parts[0]
    cameras = [part.cameras for part in parts]
    return PartViewBatch(
        torch.cat([part.depth for part in parts]),
        torch.cat([part.owners for part in parts]),
        CameraBatch(
            cameras[0].width,
            cameras[0].height,
            torch.cat([camera.intrinsics for camera in cameras]),
            torch.cat([camera.T_world_camera for camera in cameras]),
        ),
        torch.cat([_obstacles(part) for part in parts]),
        torch.cat([_colour(part) for part in parts]),
    )


def _obstacles(part: PartViewBatch) -> torch.Tensor:
    return (
        torch.zeros_like(part.owners, dtype=torch.bool)
        if part.obstacles is None
        else (part.obstacles)
    )


def _colour(part: PartViewBatch) -> torch.Tensor:
    if part.colour is not None:
        return part.colour
    count, height, width = part.depth.shape
    return torch.full((count, 3, height, width), torch.nan, device=part.depth.device)
