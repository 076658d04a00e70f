"""The data module of crops about single things, and of what rays pass of them."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import lightning
import numpy as np
import torch
from torch import Tensor

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError, SettingError
from scenefw.core.rng import Streams
from scenefw.core.settings import COUNT, NOT_NEGATIVE
from scenefw.data.epochs import EpochBatches
from scenefw.kernels.transfer import to_device
from scenefw.noise.frames import depth_noises, described
from scenefw_things.images.changes import ImageChanges
from scenefw_things.images.stored_images import OBSTACLE, StoredImages
from scenefw_things.images.stored_solids import StoredSolids
from scenefw_things.shells.batches import ObjectShellBatch, Shells
from scenefw_things.shells.crops import CropShape, crop, references, windows
from scenefw_things.shells.solid_rays import PartPlanes, shells

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from scenefw.core.part_views import PartViewBatch
    from scenefw.core.protocols import Noise
    from scenefw.core.types import Float64, GridSpec

_CROPS, _VALIDATION = 8, 9  # random streams, beside those of other data sets of images


class ObjectShells(lightning.LightningDataModule):
    """Crops about things in stored images, with the shells of the whole things (group `dataset`).

    Each image gives some of its things, others in each epoch, with other noise, in a mirror, larger
    or smaller, in other windows. Rays are cast at the true convex parts where it trains. What image
    i becomes in epoch e depends on (seed, e, i) alone.

    Args:
        folder: with `train` and `val`, each of `StoredImages` with `StoredSolids`.
        batch_size: images per step.
        objects: crops of each image.
        resolution: pixels per side of a crop.
        margins: least and greatest side of a window by what is visible of its object; validation
            takes the mean.
        min_width: across a crop (m): a speck tells little of how large its object is.
        shift: most by which a window's middle lies aside, by its side.
        min_pixels: measured pixels of an object; of less no shape follows.
        min_gap: narrower gaps of a hollow are none (m).
        colourless: chance that an image has no colours.
        brightness: most by which exposure changes, as a power of two.
        scale: most by which scenes become larger or smaller, as a power of two.
        tilt: standard deviation of the found floor's slope (degrees), along x and y each.
        lift: the same of its height (m).
        noise: disturbs the images, applied in the order of the names.
        limit: at most this many training images; None means all.
        validation_limit: at most this many validation images; None means all.
        seed: of order and changes.

    Raises:
        ConfigError: a number out of range, or noise of poses.
        StorageError: there are no images, or no solids.
    """

    grid: GridSpec | None = None

    def __init__(
        self,
        folder: str | Path,
        batch_size: int = 8,
        objects: int = 4,
        resolution: int = 96,
        margins: Sequence[float] = (1.4, 2.2),
        min_width: float = 0.14,
        shift: float = 0.1,
        min_pixels: int = 60,
        min_gap: float = 0.003,
        colourless: float = 0.3,
        brightness: float = 0.7,
        scale: float = 0.4,
        tilt: float = 0.4,
        lift: float = 0.003,
        noise: Mapping[str, Noise] | None = None,
        limit: int | None = None,
        validation_limit: int | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__()
        COUNT.require(
            batch_size=batch_size, objects=objects, resolution=resolution, min_pixels=min_pixels,
            limit=limit, validation_limit=validation_limit,
        )  # fmt: skip
        NOT_NEGATIVE.require(min_width=min_width, shift=shift, min_gap=min_gap)
        if len(margins) != 2 or not 1 <= margins[0] <= margins[1]:
            raise SettingError("margins", list(margins), "two factors of 1 or more, in order")
        self.batch_size, self.objects, self.resolution = batch_size, objects, resolution
        self.margins = (float(margins[0]), float(margins[1]))
        self.min_width, self.shift = min_width, shift
        self.min_pixels, self.min_gap, self.seed = min_pixels, min_gap, seed
        noises = depth_noises(noise, "images of things")
        self.noise_words = described(noises)
        self.changes = ImageChanges(noises, colourless, brightness, scale, tilt, lift)
        as_they_are = ImageChanges(noises, colourless, 0.0, 0.0, tilt, lift)
        self.crops = CropShape(resolution, sum(self.margins) / 2, min_width, min_pixels)
        self.training = _Part(f"{folder}/train", self.changes, min_pixels, limit)
        self.validation = _Part(f"{folder}/val", as_they_are, min_pixels, validation_limit)

    def facts(self) -> dict[str, Any]:
        """Facts about the training data."""
        things = self.training.images.facts.items()
        return {
            "things": {k: v for k, v in things if k not in ("count", "size")},
            "images": len(self.training.rows),
            "batch_size": self.batch_size,
            "objects": self.objects,
            "crops": asdict(self.crops),
            "noise": self.noise_words,
        }

    def train_dataloader(self) -> EpochBatches:
        """Shuffled batches of images."""
        return EpochBatches(len(self.training.rows), self.batch_size, self.seed)

    def val_dataloader(self) -> EpochBatches:
        """The same batches every time."""
        return EpochBatches(len(self.validation.rows), self.batch_size, None)

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ObjectShellBatch:
        """Crops of images of an epoch, each a function of only (seed, epoch, index)."""
        streams = Streams.of(self.seed, _CROPS, batch.epoch, indices=batch.indices.numpy())
        return self._crops(self.training, batch, streams, device)[0]

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ObjectShellBatch:
        """The same crops in every epoch: windows in the middle, images as they were stored."""
        return self._crops(self.validation, batch, self._fixed(batch), device)[0]

    def validation_solids(self, batch: IndexBatch) -> list[tuple[list[Float64], Float64]]:
        """The true solids of the crops of `validation_batch`, in the world of their cameras.

        Returns:
            Of each the planes (K, 4) of its convex parts, and points (P, 3) on its surface (m).
        """
        device, solids = torch.device("cpu"), self.validation.solids
        made, items, frames = self._crops(self.validation, batch, self._fixed(batch), device)
        poses = made.crops.cameras.T_world_camera.double().numpy()
        maps = poses @ np.linalg.inv(frames)
        return [_placed(solids, item, to_world)
                for item, to_world in zip(items.tolist(), maps, strict=True)]  # fmt: skip

    def _fixed(self, batch: IndexBatch) -> Streams:
        return Streams.of(self.seed, _VALIDATION, 0, indices=batch.indices.numpy())

    @torch.no_grad()
    def _crops(
        self, part: _Part, batch: IndexBatch, streams: Streams, device: torch.device
    ) -> tuple[ObjectShellBatch, NDArray[np.int64], Float64]:
        """Crops with shells, the items that they show, and maps (N, 4, 4) from cameras to items."""
        to_images, to_choice, to_window = streams.split(3)
        rows = part.rows[batch.indices.numpy()]
        views = part.changes.apply(part.images, rows, to_images, device)
        numbers = np.repeat(np.arange(len(rows)), self.objects)
        measured = torch.where(views.depth > 0, views.owners, 0).clamp_max(OBSTACLE)
        measured = measured.to(torch.uint8)
        owners = self._chosen(measured, to_choice)
        chances = to_window.uniform(3 * self.objects).reshape(-1, 3).astype(np.float32)
        if part is self.validation:
            chances[:] = 0.5
        numbers_here, owners_here, chances_here = to_device([numbers, owners, chances], device)
        squares = self._windows(views, measured, numbers_here, owners_here, chances_here)
        crops = crop(views, numbers_here, owners_here, squares, self.resolution)
        items = part.solids.items(rows[numbers] // part.views, owners.astype(np.int64))
        to_world = _frames(part, rows, to_images)[numbers]
        frames = np.linalg.inv(part.solids.poses[items]) @ to_world
        maps, *tables = to_device(
            [frames[:, :3].astype(np.float32), *_tables(part.solids, items)], device
        )
        true = shells(crops.cameras, maps, PartPlanes(*tables), self.min_gap)
        measured_pixels = _sums(measured, measured > 0)[numbers_here, owners_here.long() - 1]
        is_visible = (measured_pixels >= self.min_pixels)[:, None, None]
        true = Shells(true.depths, true.amodal & is_visible, true.hollow & is_visible)
        return ObjectShellBatch(crops, true, references(crops)[1]), items, frames

    def _chosen(self, measured: Tensor, streams: Streams) -> NDArray[np.int32]:
        """Objects (N,) of images of which enough is measured; if none is, the largest.

        Of such an object, which noise hides, no shell follows: it is empty.
        """
        pixels = _sums(measured, torch.ones_like(measured, dtype=torch.float32)).cpu().numpy()
        starts, chosen = streams.uniform(1)[:, 0], []
        for start, row in zip(starts, pixels, strict=True):
            labels = np.flatnonzero(row >= self.min_pixels)
            labels = labels if len(labels) else np.array([row.argmax()])
            first = int(start * len(labels))
            chosen.append(labels[(first + np.arange(self.objects)) % len(labels)] + 1)
        return np.concatenate(chosen).astype(np.int32)

    def _windows(
        self, views: PartViewBatch, measured: Tensor, rows: Tensor, owners: Tensor, chances: Tensor
    ) -> Tensor:
        ids = (rows, owners.long() - 1)
        distance = _sums(measured, views.depth)[ids] / _sums(measured, views.depth > 0)[ids]
        min_side = self.min_width * views.cameras.intrinsics[rows, 0] / distance
        low, high = self.margins
        margins = low + (high - low) * chances[:, 0]
        visible = measured[rows] == owners[:, None, None]
        shifts = self.shift * (2 * chances[:, 1:] - 1)
        return windows(visible, margins, shifts, min_side.nan_to_num(1.0))


def _sums(owners: Tensor, values: Tensor) -> Tensor:
    """Sums (B, OBSTACLE - 1) of values (B, H, W) over the pixels of each object, 1 first."""
    sums = torch.zeros(len(owners), OBSTACLE + 1, device=owners.device)
    sums.scatter_add_(1, owners.flatten(1).long(), values.flatten(1).float())
    return sums[:, 1:OBSTACLE]


class _Part:
    """Images and solids of a part of the data, and the images that show an object."""

    def __init__(
        self, folder: str, changes: ImageChanges, min_pixels: int, limit: int | None
    ) -> None:
        self.images = StoredImages.open(folder)
        self.solids = StoredSolids.open(f"{folder}/solids.npz")
        self.views, self.changes = int(self.images.facts["views"]), changes
        needed = len(self.images) // self.views
        if len(self.solids.item_ends) <= needed:
            raise ConfigError(f"{folder} has solids of other scenes; make both anew")
        shown = [row for row in range(len(self.images))
                 if _largest(self.images.owners[row]) >= 2 * min_pixels]  # fmt: skip
        if not shown:
            raise ConfigError(f"no image in {folder} shows an object of {2 * min_pixels} pixels")
        self.rows = np.array(shown[:limit], dtype=np.int64)


def _largest(owners: NDArray[np.uint8]) -> int:
    return int(np.bincount(owners.ravel(), minlength=OBSTACLE)[1:OBSTACLE].max())


def _frames(part: _Part, rows: NDArray[np.int64], streams: Streams) -> Float64:
    """Maps (B, 4, 4) from the frame of changed cameras to the world of their scenes."""
    stored = part.images.poses[rows].astype(np.float64)
    size = 1 / part.changes.scales(streams)
    sign = np.where(part.changes.mirrored(streams), -1.0, 1.0)
    stored[:, :3, :3] *= size[:, None, None]
    stored[:, :3, 0] *= sign[:, None]
    return stored


def _tables(solids: StoredSolids, items: NDArray[np.int64]) -> list[NDArray[Any]]:
    """Parts of some items as `PartPlanes` has them."""
    counts, ends, balls, planes = [0], [0], [], []
    for item in items.tolist():
        first, last = solids.part_ends[item], solids.part_ends[item + 1]
        sides = solids.plane_ends[first : last + 1]
        counts.append(counts[-1] + int(last - first))
        ends += (sides[1:] - sides[0] + ends[-1]).tolist()
        balls.append(solids.balls[first:last])
        planes.append(solids.planes[sides[0] : sides[-1]])
    ranges = np.column_stack([counts[:-1], counts[1:]]).astype(np.int32)
    return [ranges, np.array(ends, np.int32), np.concatenate(balls), np.concatenate(planes)]


def _placed(solids: StoredSolids, item: int, pose: Float64) -> tuple[list[Float64], Float64]:
    """Planes and surface points of an item where a map (4, 4) puts it."""
    normals = np.linalg.inv(pose)
    points = solids.points[item].astype(np.float64)
    placed = points @ pose[:3, :3].T + pose[:3, 3]
    return [planes @ normals for planes in solids.parts(item)], placed
