"""Threads of a run: how many compute, and how they wait."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from scenefw.core.cores import quota
from scenefw.core.errors import ConfigError
from scenefw.core.waiting import environment_decides, yielding


@contextmanager
def threads(count: int | None, *, yields: bool) -> Iterator[None]:
    """Within the block, torch and numba compute with this many threads.

    Args:
        count: how many; None means one for each core that the process may use, or as many as
            OpenMP's variables of the environment say. numba takes at most one for each core.
        yields: threads that wait are asleep while other programs need the cores.
    """
    import torch

    if count is None and not environment_decides():
        limit = quota()
        if limit is not None and limit.cores < torch.get_num_threads():
            count = max(int(limit.cores), 1)
    with ExitStack() as stack:
        if count is not None:
            from scenefw.kernels import threads as pools

            stack.enter_context(pools.threads(count))
        stack.enter_context(yielding(torch.get_num_threads, enabled=yields))
        yield


def require_threads(count: Any) -> None:
    """Checks a number of threads before the work.

    Raises:
        ConfigError: it is not a whole number of 1 or more.
    """
    if count is not None and (not isinstance(count, int) or isinstance(count, bool) or count < 1):
        raise ConfigError(
            f"threads is {count}; expected a whole number of 1 or more, or null for one per core"
        )
