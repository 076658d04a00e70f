"""Output whose reader has gone, as in `python -m scenefw --list | head`."""

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

_SIGPIPE = 141  # 128 + 13: what a shell reports of programs that the signal ends


@contextmanager
def ending_quietly() -> Iterator[None]:
    """Ends the process without a word, status 141, where output can't be written any more.

    The signal itself would do so too, but leave half-written files, and end a run whose helper
    process died.
    """
    try:
        yield
    except BrokenPipeError as error:
        end_if_unread(error)
        raise
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # rich has noticed
            _end()
        _flush_quietly()
        raise


def end_if_unread(error: BaseException) -> None:
    """Ends the process as above if the error says that nobody reads its output."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, BrokenPipeError) and any(map(_unread, (sys.stdout, sys.stderr))):
            _end()
        cause = cause.__cause__ or cause.__context__


def _end() -> NoReturn:
    _flush_quietly()
    sys.exit(_SIGPIPE)


def _flush_quietly() -> None:
    """Python flushes at its end, and would complain of what can't be written."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)


def _unread(stream: Any) -> bool:
    """Whether it is a pipe without a reader."""
    if not hasattr(select, "poll"):  # Windows has no such pipes
        return False
    try:
        number = stream.fileno()
    except (AttributeError, OSError, ValueError):  # None, closed, or a text in memory
        return False
    poller = select.poll()
    poller.register(number, 0)  # errors are reported in any case
    return any(event & select.POLLERR for _, event in poller.poll(0))
