"""Work on many items, several at once, each in a thread of its own.

Compiled code leaves Python to the others while it runs. Many small operations are quicker side by
side than each of them divided among threads.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from typing import TypeVar

import numba
import torch

from scenefw.core.protocols import Track
from scenefw.kernels.threads import compute_with, threads

Item = TypeVar("Item")
Result = TypeVar("Result")

_MOST = 8  # by default, as each needs memory of its own
_SHARED = ("omp", "tbb")  # pools of numba that several threads may use at once


def side_by_side(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    track: Track,
    title: str,
    workers: int | None = None,
    on_result: Callable[[Item, Result], None] = lambda *_: None,
) -> list[Result]:
    """Results in the order of the items, the same as from one worker with one thread.

    The first item is worked on alone: that loads compiled code and fills caches.

    Args:
        work: on one item, in any thread. torch and numba compute with one thread there.
        items: in their order.
        track: shows how many are done.
        title: what the items are, in a word or two.
        workers: items at once; None: as many as torch has threads, at most eight. One works in
            this thread, with all threads of torch and numba.
        on_result: called with each item and its result, in their order, in this thread.
    """
    count = min(torch.get_num_threads(), _MOST) if workers is None else workers
    if count < 2:
        return collected(map(work, items), items, track, title, on_result)
    with threads(1), closing(_results(work, items, count)) as results:
        return collected(results, items, track, title, on_result)


def collected(
    results: Iterator[Result],
    items: Sequence[Item],
    track: Track,
    title: str,
    on_result: Callable[[Item, Result], None] = lambda *_: None,
) -> list[Result]:
    """Results that come in the order of the items, with a bar of them."""
    outputs = []
    for item in track(items, title):
        result = next(results)
        on_result(item, result)
        outputs.append(result)
    return outputs


def run_single_threaded(work: Callable[[Item], Result], item: Item) -> Result:
    """The result of an item with one thread, for processes that are as many as the cores."""
    with threads(1):
        return work(item)


def _results(
    work: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Generator[Result, None, None]:
    yield from map(work, items[:1])
    if not _may_share():
        yield from map(work, items[1:])
        return
    with ThreadPoolExecutor(workers, initializer=compute_with, initargs=(1,)) as pool:
        yield from pool.map(work, items[1:])


def _may_share() -> bool:
    """Whether several threads may run numba's loops; its last resort ends the process then."""
    try:
        return numba.threading_layer() in _SHARED
    except ValueError:  # no loop has run
        return False
