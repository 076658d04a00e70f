"""A polite end from outside: what a terminal (Ctrl-C) and a system (SIGTERM) ask for."""

import signal
import threading
from types import FrameType


class Terminated(KeyboardInterrupt):
    """SIGTERM came; whatever cleans up after Ctrl-C does so after this, too."""


def stop_of(number: int) -> type[KeyboardInterrupt]:
    """What a signal raises."""
    return Terminated if number == signal.SIGTERM else KeyboardInterrupt


def raise_on_sigterm() -> None:
    """Makes SIGTERM raise as Ctrl-C does, unless somebody handles it; else `finally` is not run."""
    in_main = threading.current_thread() is threading.main_thread()
    if in_main and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _raise)


def _raise(number: int, _: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)  # another one would cut the cleaning short
    raise stop_of(number)
