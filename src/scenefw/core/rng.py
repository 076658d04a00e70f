"""Seeds: stream i of a data set depends on (seed, i) alone, whatever the number of workers."""

import numpy as np


def generator(seed: int, *stream: int) -> np.random.Generator:
    """Returns the generator of one stream, e.g. `generator(seed, scene_index)`."""
    return np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=stream))


def torch_seed(seed: int, *stream: int) -> int:
    """Returns a 63-bit seed of one stream for a `torch.Generator`."""
    state = np.random.SeedSequence(entropy=seed, spawn_key=stream).generate_state(1, np.uint64)
    return int(state[0] >> np.uint64(1))
