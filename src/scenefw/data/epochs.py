"""Batches of sample indices; each batch is computed from its own index."""

from collections.abc import Iterator

import numpy as np
import torch

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.rng import generator
from scenefw.core.settings import COUNT

_ORDER = 1  # random stream


class EpochBatches:
    """Shuffled batches of one epoch after another, any of them found by its number alone.

    The order of epoch e depends on (seed, e) alone, so a training that knows how many batches it
    has seen resumes with the very next one. The last, smaller batch of a shuffled epoch is dropped.

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
        COUNT.require(distinct_batches=distinct)
        share = scenes // world if seed is not None else len(range(rank, scenes, world))
        if batch_size < 1 or share < (batch_size if seed is not None else 1):
            per_process = f" of each of {world} processes" if world > 1 else ""
            raise ConfigError(
                f"dataset.batch_size = {batch_size}: expected 1 to {share}, the number of "
                f"scenes{per_process}; lower it or raise dataset.limit"
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
        indices = self._order(epoch)[start : start + self.batch_size]
        return IndexBatch(epoch, torch.from_numpy(indices.copy()))

    def _order(self, epoch: int) -> np.ndarray:
        if self.seed is None:
            order = np.arange(self.scenes)
        else:
            order = generator(self.seed, _ORDER, epoch).permutation(self.scenes)
        return order[self.rank :: self.world]
