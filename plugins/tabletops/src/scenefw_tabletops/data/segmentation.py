"""Batches for labelling networks, made on the training device."""

from collections.abc import Sequence
from typing import Any, Protocol

import lightning
import numpy as np
import torch
from numpy.typing import NDArray

from scenefw.core.batches import IndexBatch, SegmentationBatch
from scenefw.core.errors import ConfigError
from scenefw.core.settings import COUNT
from scenefw.data.epochs import EpochBatches


class Samples(Protocol):
    """Numbered samples, drawn again each epoch."""

    kind: str
    geometry: str

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def __len__(self) -> int:
        """Number of samples per epoch."""

    def facts(self) -> dict[str, Any]:
        """Facts about the samples and their noise, as plain data."""

    def prepare(self, device: torch.device) -> None:
        """Moves resident data to the device before the training's clock starts."""

    def batch(
        self, indices: NDArray[np.int64], epoch: int | None, device: torch.device
    ) -> SegmentationBatch:
        """Samples of an epoch, each by (seed, epoch, index) alone; None = the same always."""


class SegmentationData(lightning.LightningDataModule):
    """Hands out indices of samples, and batches of them (group `dataset`).

    Args:
        train: samples to learn from.
        validation: samples to watch the training by, of other scenes.
        batch_size: samples per step; 8 in the thesis.
        seed: seed of their order.
        distinct_batches: train on this many batches again and again, noise and all; None means all.
    """

    grid = None  # images have no voxels

    def __init__(
        self,
        train: Samples,
        validation: Samples,
        batch_size: int = 8,
        seed: int = 0,
        distinct_batches: int | None = None,
    ) -> None:
        super().__init__()
        COUNT.require(batch_size=batch_size, distinct_batches=distinct_batches)
        if tuple(train.classes) != tuple(validation.classes):
            raise ConfigError(
                f"classes of training {list(train.classes)} and of validation "
                f"{list(validation.classes)} differ; give two splits of one data set"
            )
        self.train, self.validation = train, validation
        self.batch_size, self.seed = batch_size, seed
        self.distinct_batches = distinct_batches

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return tuple(self.train.classes)

    def setup(self, stage: str | None = None) -> None:
        """Prepares all samples on the device of the training."""
        trainer = self.trainer
        device = trainer.strategy.root_device if trainer is not None else torch.device("cpu")
        for samples in (self.train, self.validation):
            samples.prepare(device)
        if device.type == "cuda":  # batches are made in another stream
            torch.cuda.synchronize(device)

    def facts(self) -> dict[str, Any]:
        """Facts about the training data."""
        return {
            "input": self.train.kind,
            "geometry": self.train.geometry,
            "classes": list(self.classes),
            "images": len(self.train),
            "validation_images": len(self.validation),
            "batch_size": self.batch_size,
            **({"distinct_batches": self.distinct_batches} if self.distinct_batches else {}),
            **self.train.facts(),
        }

    def train_dataloader(self) -> EpochBatches:
        """Shuffled batches."""
        parts = self._processes()
        return EpochBatches(
            len(self.train), self.batch_size, self.seed, *parts, self.distinct_batches
        )

    def val_dataloader(self) -> EpochBatches:
        """The same batches every time."""
        return EpochBatches(len(self.validation), self.batch_size, None, *self._processes())

    def training_batch(self, batch: IndexBatch, device: torch.device) -> SegmentationBatch:
        """The samples of an epoch."""
        return _make(self.train, batch, batch.epoch, device)

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> SegmentationBatch:
        """The same samples in every epoch."""
        return _make(self.validation, batch, None, device)

    def _processes(self) -> tuple[int, int]:
        trainer = self.trainer
        return (trainer.global_rank, trainer.world_size) if trainer is not None else (0, 1)


@torch.no_grad()
def _make(
    samples: Samples, batch: IndexBatch, epoch: int | None, device: torch.device
) -> SegmentationBatch:
    return samples.batch(batch.indices.numpy(), epoch, device)
