"""Seeds: stream i of a data set depends on (seed, i) alone, whatever the number of workers."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)


def generator(seed: int, *stream: int) -> np.random.Generator:
    """Returns the generator of one stream, e.g. `generator(seed, scene_index)`."""
    return np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=stream))


def torch_seed(seed: int, *stream: int) -> int:
    """Returns a 63-bit seed of one stream for a `torch.Generator`."""
    state = np.random.SeedSequence(entropy=seed, spawn_key=stream).generate_state(1, np.uint64)
    return int(state[0] >> np.uint64(1))


def number_of(name: str) -> int:
    """A number that stands for a name in a stream, the same in every process."""
    return zlib.crc32(name.encode())


@dataclass(frozen=True)
class Streams:
    """B independent streams that are drawn from together, by SplitMix64 (Steele et al. 2014).

    What a stream gives depends on its own key alone, not on those beside it. Drawing leaves the
    streams as they are: draw number i is always the same number.

    Args:
        keys: (B,) uint64.
    """

    keys: NDArray[np.uint64]

    @classmethod
    def of(cls, seed: int, *stream: int, indices: ArrayLike) -> Streams:
        """The streams (seed, *stream, i) of all indices i, distinct for distinct indices."""
        root = np.random.SeedSequence(entropy=seed, spawn_key=stream).generate_state(1, np.uint64)
        return cls(_mixed(root + _mixed(np.asarray(indices).astype(np.uint64) * _GOLDEN)))

    def __len__(self) -> int:
        """B."""
        return len(self.keys)

    def split(self, count: int) -> tuple[Streams, ...]:
        """`count` further streams of each, for one purpose each."""
        return tuple(Streams(keys) for keys in _mixed(~self._words(count, 0)).T)

    def uniform(self, count: int, start: int = 0) -> NDArray[np.float64]:
        """Draws start to start + count - 1 of each stream, (B, count) in [0, 1)."""
        return (self._words(count, start) >> np.uint64(11)).astype(np.float64) * 2.0**-53

    def seeds(self, count: int) -> NDArray[np.int64]:
        """The first `count` draws of each stream as seeds (B, count) of 63 bits."""
        return (self._words(count, 0) >> np.uint64(1)).astype(np.int64)

    def _words(self, count: int, start: int) -> NDArray[np.uint64]:
        counters = np.arange(start + 1, start + count + 1, dtype=np.uint64)
        return _mixed(self.keys[:, None] + counters * _GOLDEN)


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Each word's bits spread over all its bits, one to one."""
    words = (words ^ (words >> np.uint64(30))) * _FIRST
    words = (words ^ (words >> np.uint64(27))) * _SECOND
    return words ^ (words >> np.uint64(31))
