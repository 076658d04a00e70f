"""Work that several methods share: done once, and its time charged to each that asks for it."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import torch

Value = TypeVar("Value")

OTHER = "other"
"""Stage of what a method does that it shares with no other."""


class SharedWork:
    """Remembers the result and the seconds of each piece of work of a turn.

    Methods that run side by side ask in turn, frame by frame: the first of them has the work done,
    the others get the same result, and all of them pay what it took. `turn` is set by whoever runs
    them; a new turn means new work.
    """

    def __init__(self) -> None:
        self.turn = 0
        self._kept: dict[tuple[str, str], tuple[int, Any, float]] = {}
        self._spent: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
        self._calls: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
        self._asking = ""
        self._done = 0.0  # seconds of work that was really done

    @contextmanager
    def of(self, method: str) -> Iterator[None]:
        """Charges what is asked for in this block to a method; as `OTHER` what it does alone."""
        before, self._asking = self._asking, method
        start, done = time.perf_counter(), self._done
        try:
            yield
        finally:
            alone = time.perf_counter() - start - (self._done - done)
            self._spent[method][OTHER] += alone
            self._asking = before

    def do(self, stage: str, what: str, work: Callable[[], Value]) -> Value:
        """The result of a piece of work, done now or, in the same turn, remembered.

        Args:
            stage: that its seconds count for.
            what: its name in the stage.
            work: does it.
        """
        kept = self._kept.get((stage, what))
        if kept is None or kept[0] != self.turn:
            _wait_for_gpu()
            start = time.perf_counter()
            value = work()
            _wait_for_gpu()
            seconds = time.perf_counter() - start
            self._done += seconds
            kept = self._kept[stage, what] = (self.turn, value, seconds)
        self._spent[self._asking][stage] += kept[2]
        self._calls[self._asking][stage] += 1
        result: Value = kept[1]
        return result

    def spent(self, method: str) -> dict[str, float]:
        """Seconds of a method by stage."""
        return dict(self._spent[method])

    def calls(self, method: str) -> dict[str, int]:
        """How often a method asked for work, by stage."""
        return dict(self._calls[method])


def _wait_for_gpu() -> None:
    if torch.cuda.is_available():
        torch.cuda.synchronize()
