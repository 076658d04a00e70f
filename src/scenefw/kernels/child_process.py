"""Code compiled in copies of this process, which fill numba's cache and end."""

import functools
import gc
import os
import signal
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from llvmlite.binding import ffi
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

_PATIENCE = 300.0  # s, in which a loop is compiled on the slowest machine
_STUCK = 10.0  # s in which a copy of this process that computes nothing waits for what never comes


def compile_in_child(function: Any, types: tuple[Any, ...]) -> None:
    """Fills numba's cache from a copy of this process, which does nothing else, unless it is full.

    Where processes can't be copied the caller compiles for itself, as it does if the child fails.
    """
    can_compile = isinstance(function, Dispatcher)  # plain functions where numba is switched off
    if not hasattr(os, "fork") or not can_compile or is_cached(function, types):
        return
    _announce()
    with _turn(function):
        if not is_cached(function, types):
            _compile_in_copy(function, types)


@contextmanager
def _turn(function: Any) -> Iterator[None]:
    """Waits while another process compiles the function: what that leaves may be what is needed."""
    import fcntl  # not where processes can't be copied

    with ExitStack() as turn:
        with suppress(AttributeError, OSError, TypeError):  # another numba, a disk without locks
            folder = Path(function._cache.cache_path)
            folder.mkdir(parents=True, exist_ok=True)
            lock = turn.enter_context((folder / f"{function.__name__}.lock").open("w"))
            fcntl.flock(lock, fcntl.LOCK_EX)
            turn.callback(fcntl.flock, lock, fcntl.LOCK_UN)  # copies hold the open file, too
        yield


def _compile_in_copy(function: Any, types: tuple[Any, ...]) -> None:
    child = _copy_of_this_process()
    if child == 0:
        status = 1
        gc.disable()  # ends of objects may wait for threads, and there are none here
        try:
            function.compile(types)
            status = 0
        finally:
            os._exit(status)
    _wait(child)


@functools.cache
def _announce() -> None:
    """Says once, to whoever waits at a terminal, why nothing seems to happen."""
    if sys.stderr is not None and sys.stderr.isatty():
        print(
            "compiling kernels, once per machine and version: tens of seconds ...",
            file=sys.stderr,
            flush=True,
        )


def _copy_of_this_process() -> int:
    """Its number; 0 in the copy.

    Only this thread lives on in the copy. What another one has locked at this moment stays locked
    there for ever, so this thread takes the locks of numba and LLVM before.
    """
    with warnings.catch_warnings(), global_compiler_lock, ffi.lib._lock:
        warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 warns of threads
        return os.fork()


def _wait(child: int) -> None:
    """Until a process ends; one that takes too long, or that only waits, is killed.

    A lock of another thread may be held in the copy for ever, in spite of all care.
    """
    until, pause = time.monotonic() + _PATIENCE, 0.001
    computed, last_progress = _computed(child), time.monotonic()
    while time.monotonic() < min(until, last_progress + _STUCK):
        if os.waitpid(child, os.WNOHANG)[0]:
            return
        time.sleep(pause)
        pause = min(2 * pause, 0.05)
        now = _computed(child)
        if now is None or now != computed:
            computed, last_progress = now, time.monotonic()
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def _computed(process: int) -> int | None:
    """Ticks of the clock that a process has computed; None where the system doesn't tell."""
    try:
        stat_line = Path(f"/proc/{process}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    fields = stat_line.rpartition(")")[2].split()  # after the name, which may hold spaces
    return int(fields[11]) + int(fields[12])


def is_cached(function: Any, types: tuple[Any, ...]) -> bool:
    """Whether numba will read this code back; it has no public question for that.

    The copied process would ask too, but a copy of a program with torch costs a tenth of a second.
    """
    try:
        key = function._cache._index_key(types, function.targetctx.codegen())
        files = function._cache._cache_file
        name = files._load_index().get(key)
        return name is not None and Path(files._data_path(name)).is_file()
    except (AttributeError, OSError, TypeError):  # another numba: the copied process finds out
        return False
