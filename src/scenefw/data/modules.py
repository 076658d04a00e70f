"""Batches of scene indices: what a training step turns into volumes on its own device."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import lightning
import numpy as np
import torch
from torch import Tensor

from scenefw.core.errors import ConfigError
from scenefw.core.rng import generator
from scenefw.data.stacks import StackScenes

_ORDER = 1  # stream of the order of scenes; views have their own


@dataclass(frozen=True)
class IndexBatch:
    """Positions of scenes in their split, and the epoch that asks for them."""

    epoch: int
    indices: Tensor

    def to(self, *_args: Any, **_options: Any) -> "IndexBatch":
        """Itself: indices stay where the parameters are."""
        return self


class EpochBatches:
    """Shuffled batches of one epoch after another, any of them found by its number alone.

    The order of epoch e depends on (seed, e) alone, so a training that knows how many batches it
    has seen goes on with the very next one. The last, smaller batch of a shuffled epoch is dropped.

    Args:
        scenes: number of scenes.
        batch_size: scenes per batch.
        seed: seed of the order; None keeps the stored order, and the smaller last batch.
        rank: which part of every epoch, with several processes.
        world: number of processes.
        distinct: batches after which the first one comes again, as it was; None means never.
    """

    def __init__(
        self,
        scenes: int,
        batch_size: int,
        seed: int | None,
        rank: int = 0,
        world: int = 1,
        distinct: int | None = None,
    ) -> None:
        if distinct is not None and distinct < 1:
            raise ConfigError(
                f"dataset.distinct_batches is {distinct}; expected 1 or more, or null"
            )
        share = scenes // world if seed is not None else len(range(rank, scenes, world))
        if batch_size < 1 or share < (batch_size if seed is not None else 1):
            raise ConfigError(
                f"batch size {batch_size} does not fit {scenes} scenes on {world} processes; "
                "lower dataset.batch_size or raise dataset.limit"
            )
        self.scenes, self.batch_size, self.seed = scenes, batch_size, seed
        self.rank, self.world, self.distinct = rank, world, distinct
        self._length = share // batch_size if seed is not None else -(-share // batch_size)

    def __len__(self) -> int:
        """Batches per epoch."""
        return self._length

    def __iter__(self) -> Iterator[IndexBatch]:
        """The batches of the first epoch."""
        return (self.batch(number) for number in range(len(self)))

    def batch(self, number: int) -> IndexBatch:
        """Batch `number`, counted through all epochs."""
        epoch, position = divmod(number % self.distinct if self.distinct else number, len(self))
        start = position * self.batch_size
        chosen = self._order(epoch)[start : start + self.batch_size]
        return IndexBatch(epoch, torch.from_numpy(chosen.copy()))

    def _order(self, epoch: int) -> np.ndarray:
        if self.seed is None:
            order = np.arange(self.scenes)
        else:
            order = generator(self.seed, _ORDER, epoch).permutation(self.scenes)
        return order[self.rank :: self.world]


class StackData(lightning.LightningDataModule):
    """Hands out indices of the scenes of two splits (group `dataset`); no volume is ever stored.

    Args:
        path: the `.npz` of a data set, the name of a shipped one (stacks, scattered), or several;
            None means the shipped stacks.
        limit: at most this many training scenes; None means all.
        validation_limit: at most this many validation scenes; None means all.
        batch_size: scenes per step.
        seed: seed of the order of scenes.
        distinct_batches: train on this many batches again and again, views and all; None means all.
    """

    def __init__(
        self,
        path: str | Sequence[str] | None = None,
        limit: int | None = None,
        validation_limit: int | None = 64,
        batch_size: int = 8,
        seed: int = 0,
        distinct_batches: int | None = None,
    ) -> None:
        super().__init__()
        self.distinct_batches = distinct_batches
        self.scenes = StackScenes(path, "train", limit)
        self.validation_scenes = StackScenes(path, "val", validation_limit)
        self.batch_size, self.seed = batch_size, seed

    def facts(self) -> dict[str, Any]:
        """What a network learns from."""
        return {
            "data": self.scenes.sizes,
            "scenes": len(self.scenes),
            "validation_scenes": len(self.validation_scenes),
            "batch_size": self.batch_size,
            **({"distinct_batches": self.distinct_batches} if self.distinct_batches else {}),
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

    def _processes(self) -> tuple[int, int]:
        trainer = self.trainer
        return (trainer.global_rank, trainer.world_size) if trainer is not None else (0, 1)
