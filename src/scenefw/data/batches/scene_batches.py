"""What data modules of scenes share: two splits, batches of their indices, facts about them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import lightning
import torch

from scenefw.core.rng import Streams
from scenefw.core.settings import COUNT
from scenefw.data.batches.stacks import StackScenes
from scenefw.data.epochs import EpochBatches

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.batches import IndexBatch


class SceneBatches(lightning.LightningDataModule):
    """Training and validation scenes of a data set, whose batches are indices.

    Args:
        path: the `.npz` of a data set, the name of a shipped one, or several; None means stacks.
        limit: at most this many training scenes; None means all.
        validation_limit: at most this many validation scenes; None means all.
        batch_size: scenes per step.
        seed: seed of the order of scenes, and of what a subclass makes of them.
        distinct_batches: train on this many batches again and again; None means all.
    """

    def __init__(
        self,
        path: str | Sequence[str] | None,
        limit: int | None,
        validation_limit: int | None,
        batch_size: int,
        seed: int,
        distinct_batches: int | None,
    ) -> None:
        super().__init__()
        COUNT.require(batch_size=batch_size, distinct_batches=distinct_batches)
        self.scenes = StackScenes(path, "train", limit)
        self.validation_scenes = StackScenes(path, "val", validation_limit)
        self.batch_size, self.seed = batch_size, seed
        self.distinct_batches = distinct_batches

    @property
    def noise_words(self) -> str | list[str]:
        """What disturbs the views, for the facts about a training."""
        raise NotImplementedError

    @property
    def most(self) -> int:
        """The largest number of objects in a scene."""
        sets = (self.scenes, self.validation_scenes)
        counts = [s.parameters(list(range(len(s)))).present.sum(dim=1) for s in sets]
        return int(torch.cat(counts).max())

    def facts(self) -> dict[str, Any]:
        """Facts about the training data."""
        return {
            "data": self.scenes.sizes,
            "scenes": len(self.scenes),
            "validation_scenes": len(self.validation_scenes),
            "batch_size": self.batch_size,
            **({"distinct_batches": self.distinct_batches} if self.distinct_batches else {}),
            "noise": self.noise_words,
        }

    def train_dataloader(self) -> EpochBatches:
        """Shuffled batches."""
        parts = self._processes()
        return EpochBatches(
            len(self.scenes), self.batch_size, self.seed, *parts, self.distinct_batches
        )

    def val_dataloader(self) -> EpochBatches:
        """The same batches every time."""
        return EpochBatches(len(self.validation_scenes), self.batch_size, None, *self._processes())

    def streams(self, batch: IndexBatch, number: int) -> Streams:
        """A random stream per scene of a batch, of (seed, epoch, index) and `number` alone."""
        return Streams.of(self.seed, number, batch.epoch, indices=batch.indices.numpy())

    def _processes(self) -> tuple[int, int]:
        trainer = self.trainer
        return (trainer.global_rank, trainer.world_size) if trainer is not None else (0, 1)
