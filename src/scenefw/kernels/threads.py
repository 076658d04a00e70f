"""How many threads torch and numba compute with."""

from collections.abc import Iterator
from contextlib import contextmanager

import numba
import torch


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Within the block, both compute with this many; numba with at most one for each core."""
    before = torch.get_num_threads(), numba.get_num_threads()
    compute_with(count)
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        numba.set_num_threads(before[1])


def compute_with(count: int) -> None:
    """From now on, in the thread that asks; numba first, as it may set both."""
    numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
    torch.set_num_threads(count)
