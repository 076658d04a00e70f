"""Samples and batches for labelling networks: views with depth, and crops of height maps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import lightning
import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import track
from torch import Tensor

from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightMap
from scenefw.core.labels import UNKNOWN
from scenefw.core.protocols import FrameSource, Noise
from scenefw.core.rng import generator
from scenefw.core.types import Frame, SegmentationBatch
from scenefw.data.distances import DEPTH, HEIGHT, distance_image
from scenefw.data.modules import EpochBatches, IndexBatch
from scenefw.kernels.cameras import stack_cameras

_VIEW, _CROP, _HELD_OUT = 5, 6, 7  # random streams


@dataclass(frozen=True)
class LabelledImage:
    """One sample.

    Args:
        colour: (H, W, 3) uint8.
        distance: (H, W) float32 depth or height (m), NaN = missing.
        labels: (H, W) int8 class ids, -1 = unknown.
    """

    colour: NDArray[np.uint8]
    distance: NDArray[np.float32]
    labels: NDArray[np.int8]


class Samples(Protocol):
    """Numbered samples, drawn anew each epoch."""

    kind: str
    geometry: str
    classes: Sequence[str]
    source: FrameSource

    def fetch(self, scene: int) -> bool:
        """Keeps what a scene gives; False if there is no more room."""

    def __len__(self) -> int:
        """Number of samples per epoch."""

    def sample(self, index: int, epoch: int | None) -> LabelledImage:
        """Sample of an epoch, by (seed, epoch, index) alone; None = as it is, the same always."""


class ColourJitter:
    """Other light and other cameras: brightness, contrast and tint drawn for each image.

    Args:
        brightness: factors are drawn from 1 +- this.
        contrast: the same, about the image's mean.
        tint: the same, for each of the three colours.
    """

    def __init__(self, brightness: float = 0.2, contrast: float = 0.2, tint: float = 0.05) -> None:
        if not all(0 <= value < 1 for value in (brightness, contrast, tint)):
            raise ConfigError(
                f"colour jitter has brightness = {brightness}, contrast = {contrast}, tint = "
                f"{tint}; expected shares from 0 to below 1"
            )
        self.brightness, self.contrast, self.tint = brightness, contrast, tint

    def apply(self, colour: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
        """The image (H, W, 3) in another light."""
        gain = 1 + rng.uniform(-1, 1, 3) * self.tint
        gain = (gain * (1 + rng.uniform(-1, 1) * self.brightness)).astype(np.float32)
        contrast = np.float32(1 + rng.uniform(-1, 1) * self.contrast)
        mean = np.float32(colour.mean())
        light = ((colour - mean) * contrast + mean) * gain
        return light.clip(0, 255).astype(np.uint8)


class ViewSamples:
    """Views of scenes: colour, depth or height, labels (thesis 4.6.1, fig. 4.16).

    Args:
        source: the scenes.
        views: of each scene.
        noise: disturbs depth anew in every epoch, applied in the order of the names; noise of
            poses changes nothing here.
        jitter: changes the light; None leaves it.
        memory: megabytes of views kept, the first ones; the others are fetched again.
        seed: of noise and light.
        geometry: the network sees depth (as in the thesis), or height above the table.
    """

    kind = "views"

    def __init__(
        self,
        source: FrameSource,
        views: int = 40,
        noise: Mapping[str, Noise] | None = None,
        jitter: ColourJitter | None = None,
        memory: float = 1500.0,
        seed: int = 0,
        geometry: str = DEPTH,
    ) -> None:
        self.source, self.views, self.jitter, self.seed = source, views, jitter, seed
        self.geometry = geometry
        self.noise = {n: noise[n] for n in sorted(noise or {}) if hasattr(noise[n], "apply")}  # type: ignore[index]
        self.classes = tuple(source.classes)
        self._kept = Kept(memory)

    def __len__(self) -> int:
        """Views of all scenes."""
        return len(self.source) * self.views

    def sample(self, index: int, epoch: int | None) -> LabelledImage:
        """View number index % views of scene index // views."""
        frame = self._kept.get(index, lambda: self._frame(index))
        depth, colour, labels = frame.depth, frame.colour, frame.labels
        if epoch is not None:
            rng = generator(self.seed, _VIEW, epoch, index)
            depth = self._disturbed(frame, rng)
            colour = self.jitter.apply(colour, rng) if self.jitter else colour
        return LabelledImage(colour, distance_image(frame, self.geometry, depth), labels)

    def fetch(self, scene: int) -> bool:
        """Keeps the views of a scene, which are fastest made together; whether there is room."""
        if not self._kept.full:
            for view, frame in enumerate(self.source.frames(scene, self.views)):
                self._kept.keep(scene * self.views + view, _compact(frame))
        return not self._kept.full

    def _frame(self, index: int) -> Frame:
        scene, view = divmod(index, self.views)
        return _compact(next(iter(self.source.frames(scene, 1, view))))

    def _disturbed(self, frame: Frame, rng: np.random.Generator) -> NDArray[np.float32]:
        depth, cameras = torch.from_numpy(frame.depth.copy())[None], stack_cameras([frame.camera])
        seeds = torch.from_numpy(rng.integers(2**63 - 1, size=(len(self.noise), 1)))
        for noise, seed in zip(self.noise.values(), seeds, strict=True):
            depth = noise.apply(depth, cameras, seed)
        return depth[0].numpy()


class MapCrops:
    """Crops of height maps: colour, height above the table, labels (thesis 4.6.1, fig. 4.17).

    Args:
        source: the scenes, with their true labels.
        crops: of each scene and epoch.
        size: width and height of a crop (vertices).
        maps: gives the fused map of a scene by its number; None crops the true maps.
        flips: mirror crops at random, for classes that don't tell left from right.
        jitter: changes the light; None leaves it.
        height_noise: standard deviation of noise on heights (m), as fused maps are not smooth.
        unseen: share of crops of which a random line cuts off a part as unseen, as maps have that
            are not finished.
        memory: megabytes of maps kept, the first ones; the others are fetched again.
        seed: of places, flips, noise and light.
    """

    kind = "maps"
    geometry = HEIGHT

    def __init__(
        self,
        source: FrameSource,
        crops: int = 40,
        size: Sequence[int] = (320, 240),
        maps: Callable[[int], HeightMap] | None = None,
        jitter: ColourJitter | None = None,
        height_noise: float = 0.0,
        unseen: float = 0.0,
        memory: float = 1500.0,
        seed: int = 0,
        *,
        flips: bool = True,
    ) -> None:
        self.source, self.crops, self.size, self.maps = source, crops, tuple(size), maps
        self.jitter, self.height_noise, self.unseen = jitter, height_noise, unseen
        self.seed, self.flips = seed, flips
        self.classes = tuple(source.classes)
        self._kept = Kept(memory)

    def __len__(self) -> int:
        """Crops of all scenes."""
        return len(self.source) * self.crops

    def sample(self, index: int, epoch: int | None) -> LabelledImage:
        """A crop of scene index // crops, elsewhere in every epoch."""
        scene = index // self.crops
        whole = self._kept.get(scene, lambda: self._whole(scene))
        stream = (_HELD_OUT, index) if epoch is None else (_CROP, epoch, index)
        rng = generator(self.seed, *stream)
        part = self._crop(whole, rng)
        return part if epoch is None else self._changed(part, rng)

    def fetch(self, scene: int) -> bool:
        """Keeps the map of a scene; whether there is room."""
        if not self._kept.full:
            self._kept.get(scene, lambda: self._whole(scene))
        return not self._kept.full

    def _whole(self, scene: int) -> LabelledImage:
        truth = self.source.truth(scene)
        shown = truth if self.maps is None else self.maps(scene)
        if truth.labels is None or shown.heights.shape != truth.labels.shape:
            raise ConfigError(
                f"the map of scene {scene} has {shown.heights.shape} vertices and its truth "
                f"{truth.heights.shape} with{'' if truth.labels is not None else 'out'} labels; "
                "give maps and truth on one grid"
            )
        labels = np.where(shown.seen, truth.labels, UNKNOWN).astype(np.int8)
        return LabelledImage(shown.colour, shown.heights, labels)

    def _crop(self, whole: LabelledImage, rng: np.random.Generator) -> LabelledImage:
        width, height = self.size
        rows, columns = whole.labels.shape
        top = int(rng.integers(max(rows - height, 0) + 1))
        left = int(rng.integers(max(columns - width, 0) + 1))
        at = slice(top, top + height), slice(left, left + width)
        return LabelledImage(whole.colour[at], whole.distance[at], whole.labels[at])

    def _changed(self, part: LabelledImage, rng: np.random.Generator) -> LabelledImage:
        colour = self.jitter.apply(part.colour, rng) if self.jitter else part.colour
        noise = rng.standard_normal(part.distance.shape, np.float32) * np.float32(self.height_noise)
        axes = tuple(axis for axis in (0, 1) if self.flips and rng.random() < 0.5)
        hidden = np.flip(
            _beyond_a_line(part.labels.shape, rng) & (rng.random() < self.unseen), axes
        )
        return LabelledImage(
            np.where(hidden[..., None], np.uint8(0), np.flip(colour, axes)),
            np.where(hidden, np.float32(np.nan), np.flip(part.distance + noise, axes)),
            np.where(hidden, np.int8(UNKNOWN), np.flip(part.labels, axes)),
        )


def _beyond_a_line(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.bool_]:
    """One side of a line through a random point of an image."""
    row, column = rng.uniform(0, shape[0]), rng.uniform(0, shape[1])
    angle = rng.uniform(0, 2 * np.pi)
    y, x = np.ogrid[: shape[0], : shape[1]]
    return (y - row) * np.sin(angle) + (x - column) * np.cos(angle) > 0


class Kept:
    """The first things that were fetched, up to so many megabytes."""

    def __init__(self, memory: float) -> None:
        self._left = memory * 1e6
        self._things: dict[int, Any] = {}
        self.full = False

    def get(self, key: int, fetch: Callable[[], Any]) -> Any:
        """What is kept under the key, else what is fetched."""
        if key not in self._things:
            thing = fetch()
            self.keep(key, thing)
            return thing
        return self._things[key]

    def keep(self, key: int, thing: Any) -> None:
        """Keeps a dataclass of arrays, if there is room."""
        size = sum(v.nbytes for v in vars(thing).values() if isinstance(v, np.ndarray))
        self.full |= size > self._left
        if not self.full and key not in self._things:
            self._things[key] = thing
            self._left -= size


class SegmentationData(lightning.LightningDataModule):
    """Hands out numbers of samples, and the batches of them (group `dataset`).

    Args:
        train: samples to learn from.
        validation: samples to watch the training by, of other scenes.
        batch_size: samples per step; 8 in the thesis.
        seed: seed of their order.
    """

    def __init__(
        self, train: Samples, validation: Samples, batch_size: int = 8, seed: int = 0
    ) -> None:
        super().__init__()
        if tuple(train.classes) != tuple(validation.classes):
            raise ConfigError(
                f"classes of training {list(train.classes)} and of validation "
                f"{list(validation.classes)} differ; give two splits of one data set"
            )
        self.train, self.validation = train, validation
        self.batch_size, self.seed = batch_size, seed

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return tuple(self.train.classes)

    def setup(self, stage: str | None = None) -> None:
        """Fetches what there is room for, so that a training's clock counts training alone."""
        for samples in (self.train, self.validation):
            for scene in track(range(len(samples.source)), f"fetching {samples.kind}"):
                if not samples.fetch(scene):
                    break

    def facts(self) -> dict[str, Any]:
        """What a network learns from."""
        return {
            "input": self.train.kind,
            "geometry": self.train.geometry,
            "classes": list(self.classes),
            "scenes": len(self.train.source),
            "validation_scenes": len(self.validation.source),
            "images": len(self.train),
            "noise": sorted(getattr(self.train, "noise", {})),
            "batch_size": self.batch_size,
        }

    def train_dataloader(self) -> EpochBatches:
        """Shuffled batches."""
        return EpochBatches(len(self.train), self.batch_size, self.seed, *self._processes())

    def val_dataloader(self) -> EpochBatches:
        """The same batches every time."""
        return EpochBatches(len(self.validation), self.batch_size, None, *self._processes())

    def training_batch(self, batch: IndexBatch, device: torch.device) -> SegmentationBatch:
        """The samples of an epoch."""
        return collate([self.train.sample(int(i), batch.epoch) for i in batch.indices], device)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> SegmentationBatch:
        """The same samples in every epoch."""
        return collate([self.validation.sample(int(i), None) for i in batch.indices], device)

    def _processes(self) -> tuple[int, int]:
        trainer = self.trainer
        return (trainer.global_rank, trainer.world_size) if trainer is not None else (0, 1)


def _compact(frame: Frame) -> Frame:
    """The frame with labels in a quarter of the memory.

    Raises:
        ConfigError: it has no colour or no labels.
    """
    if frame.colour is None or frame.labels is None:
        raise ConfigError(
            f"frame {frame.name} has no {'colour' if frame.colour is None else 'labels'}; "
            "training needs both"
        )
    return replace(frame, labels=frame.labels.astype(np.int8))


def collate(samples: Sequence[LabelledImage], device: torch.device | str) -> SegmentationBatch:
    """Samples of one size as tensors on a device."""
    colour = torch.stack([image_tensor(s.colour) for s in samples])
    distance = torch.from_numpy(np.stack([s.distance for s in samples])).float()[:, None]
    labels = torch.from_numpy(np.stack([s.labels for s in samples])).long()
    return SegmentationBatch(colour.to(device), distance.to(device), labels.to(device))


def image_tensor(colour: NDArray[np.uint8]) -> Tensor:
    """An image (H, W, 3) uint8 as (3, H, W) float32 in [0, 1], as networks take it."""
    return torch.from_numpy(np.ascontiguousarray(colour)).permute(2, 0, 1).float() / 255
