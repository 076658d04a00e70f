"""The parts of a data set of stacks, and which of them a scene belongs to."""

import numpy as np

from scenefw.core import rng as streams

SPLITS = ("train", "val", "test", "final")
_SHARES = {"train": 0.70, "val": 0.15, "test": 0.15}  # final: a data set of its own
_STREAM = 1  # apart from the stream that makes the scene


def split_of(seed: int, index: int) -> str:
    """train, val or test (70 / 15 / 15 %); depends on (seed, index) alone.

    So a scene stays in its part however many others are generated.
    """
    draw = streams.generator(seed, index, _STREAM).random()
    edges = np.cumsum(list(_SHARES.values()))[:-1]
    return list(_SHARES)[int(np.searchsorted(edges, draw, side="right"))]
