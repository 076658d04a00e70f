"""Waiting threads: spinning while the cores are free, asleep while other programs need them.

The threads of a pool synchronise after each operation. libgomp, the pool of torch and of numba on
Linux, lets those that are early spin for milliseconds, as waking a thread takes longer than many an
operation. With other programs running that is ruinous: a spinning thread takes the core from the
thread that all wait for. libgomp reads the time to spin only once, when it is loaded. But it does
not spin at all while a process has more threads in its pools than there are cores. So we add one
more pool, whose threads all sleep.

Neither the number of threads that compute nor their shares of the work change, so results don't.
"""

import ctypes
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from scenefw.core.cores import Neighbours, supplies

_INTERVAL = 0.5  # seconds between checks: /proc/stat counts in hundredths
_QUIET_LOOKS = 3  # checks until threads spin again
_MAPS = Path("/proc/self/maps")
_VARIABLES = ("OMP_NUM_THREADS", "OMP_WAIT_POLICY", "GOMP_SPINCOUNT")


@contextmanager
def yielding(threads: Callable[[], int], *, enabled: bool = True) -> Iterator[None]:
    """Within the block, waiting threads sleep while other programs need the cores.

    Args:
        threads: how many compute.
        enabled: if not, or if OpenMP's variables of the environment choose, nothing is done.
    """
    cores = supplies() if enabled and not environment_decides() else []
    if not cores:
        yield
        return
    over = threading.Event()
    watch = threading.Thread(target=_watch, args=(Neighbours(cores), threads, over), daemon=True)
    watch.start()
    try:
        yield
    finally:
        over.set()
        watch.join()


def environment_decides() -> bool:
    """Whether the environment says how many threads compute, or how they wait."""
    return any(name in os.environ for name in _VARIABLES)


def _watch(neighbours: Neighbours, threads: Callable[[], int], over: threading.Event) -> None:
    sleepers, quiet = Sleepers(), 0
    while not over.wait(_INTERVAL):
        count = threads()
        quiet = 0 if count > 1 and neighbours.crowd(count) else quiet + 1
        if quiet == 0:
            sleepers.add()
        elif quiet >= _QUIET_LOOKS:
            sleepers.remove()
    sleepers.remove()


class Sleepers:
    """More threads than cores in each libgomp of this process, all asleep."""

    def __init__(self) -> None:
        self._groups: dict[str, tuple[threading.Thread, threading.Event]] = {}

    def add(self) -> None:
        """Adds missing ones; libraries may have been loaded since the last call."""
        for library in pools():
            if library not in self._groups:
                ready, over = threading.Event(), threading.Event()
                owner = threading.Thread(target=_own_pool, args=(library, ready, over), daemon=True)
                owner.start()
                ready.wait()
                self._groups[library] = owner, over

    def remove(self) -> None:
        """Ends them all."""
        for owner, over in self._groups.values():
            over.set()
            owner.join()
        self._groups.clear()


def pools() -> list[str]:
    """The files of all libgomp in this process: torch brings its own, numba takes the system's."""
    names = {line.split(maxsplit=5)[-1] for line in _MAPS.read_text().splitlines()}
    return sorted(name for name in names if Path(name).name.startswith("libgomp"))


def _own_pool(library: str, ready: threading.Event, over: threading.Event) -> None:
    """A pool belongs to the thread that first computes in parallel, and ends with it."""
    try:
        no_op = ctypes.cast(ctypes.CDLL(None).sched_yield, ctypes.c_void_p)
        count = ctypes.c_uint(len(os.sched_getaffinity(0)) + 1)
        ctypes.CDLL(library).GOMP_parallel(no_op, None, count, ctypes.c_uint(0))
    finally:
        ready.set()
    over.wait()
