"""Work that several methods share: done once, with its time charged to each of them."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import torch

Value = TypeVar("Value")

OTHER = "other"
"""Stage of what a method does that it shares with no other."""


class SharedWork:
    """Remembers the result and the seconds of each piece of work of a turn.

    Methods run side by side, frame by frame: the first that needs a piece of work has it done, the
    others get the same result, and all of them are charged its time. Whoever runs them begins a
    new turn with each frame, in which all work is done again.
    """

    def __init__(self) -> None:
        self.turn = 0
        self._results: dict[Hashable, tuple[tuple[object, ...], Any, float]] = {}
        self._spent: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
        self._calls: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
        self._method = ""
        self._work_seconds = 0.0  # seconds of work actually done

    def begin_turn(self, turn: int) -> None:
        """Forgets the results of the previous turn."""
        if turn != self.turn:
            self._results.clear()
        self.turn = turn

    @contextmanager
    def of(self, method: str) -> Iterator[None]:
        """Charges the work of this block to a method; work that is not shared counts as `OTHER`."""
        before, self._method = self._method, method
        start, work_seconds = time.perf_counter(), self._work_seconds
        try:
            yield
        finally:
            unshared_seconds = time.perf_counter() - start - (self._work_seconds - work_seconds)
            self._spent[method][OTHER] += unshared_seconds
            self._method = before

    def do(
        self, stage: str, name: Hashable, work: Callable[[], Value], inputs: tuple[object, ...] = ()
    ) -> Value:
        """The result of a piece of work, done now or remembered from the same turn.

        Args:
            stage: that its seconds count for.
            name: its name in the stage.
            work: does it.
            inputs: objects that the result depends on; with other ones it is done again.
        """
        key = (stage, name, *map(id, inputs))
        if key not in self._results:
            _wait_for_gpu()
            start = time.perf_counter()
            value = work()
            _wait_for_gpu()
            seconds = time.perf_counter() - start
            self._work_seconds += seconds
            self._results[key] = (
                inputs,
                value,
                seconds,
            )  # keeps inputs alive: unique ids
        _, result, seconds = self._results[key]
        self._spent[self._method][stage] += seconds
        self._calls[self._method][stage] += 1
        return result  # type: ignore[no-any-return]

    def spent(self, method: str) -> dict[str, float]:
        """Seconds of a method by stage."""
        return dict(self._spent[method])

    def calls(self, method: str) -> dict[str, int]:
        """How often a method needed work, by stage."""
        return dict(self._calls[method])


def _wait_for_gpu() -> None:
    if torch.cuda.is_available():
        torch.cuda.synchronize()
