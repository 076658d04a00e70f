"""Seconds of training, without validation and snapshots."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

_WARM_UP = 2  # first steps of a call, not counted in its rate: kernels are compiled in them


class Clock:
    """Counts the seconds of a training over all its calls, and the steps per second of this one."""

    def __init__(self) -> None:
        self.seconds = 0.0
        """Of training so far."""
        self._began = time.monotonic()
        self._since, self._warm = (0, 0.0), 0

    def start(self, step: int) -> None:
        """A call of the training begins at this step."""
        self._since, self._warm = (step, self.seconds), step + _WARM_UP
        self.resume()

    def count(self) -> None:
        """Adds the time since the last call."""
        now = time.monotonic()
        self.seconds += now - self._began
        self._began = now

    def resume(self) -> None:
        """Leaves out the time since the last call."""
        self._began = time.monotonic()

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """Excluded from training time."""
        self.count()
        yield
        self.resume()

    def next_step(self, step: int) -> None:
        """A step begins."""
        self.count()
        if step == self._warm:
            self._since = (step, self.seconds)

    def rate(self, step: int) -> float:
        """Steps per second of this call, without its first ones."""
        steps, seconds = step - self._since[0], self.seconds - self._since[1]
        return steps / max(seconds, 1e-9)
