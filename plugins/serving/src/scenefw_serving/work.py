"""Work that one thread does for many, one piece after another."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from scenefw.core.errors import WorkerError

_Job = tuple["Future[Any]", Callable[[], Any]]


class Work:
    """Pieces of work in the order in which they came; whoever calls `run` does them."""

    def __init__(self) -> None:
        self._jobs: deque[_Job] = deque()
        self._changed = threading.Condition()

    def submit(self, job: Callable[[], Any]) -> Future[Any]:
        """Adds a piece of work; one whose future is cancelled before its turn is never done."""
        future: Future[Any] = Future()
        with self._changed:
            self._jobs.append((future, job))
            self._changed.notify()
        future.add_done_callback(self._forget)
        return future

    def run(self, seconds: float | None = None) -> None:
        """Works until the time is over, or until KeyboardInterrupt.

        Args:
            seconds: None = without an end.
        """
        end = None if seconds is None else time.monotonic() + seconds
        while True:
            with self._changed:
                left = None if end is None else max(end - time.monotonic(), 0)
                if not self._changed.wait_for(lambda: self._jobs, left):
                    return
                future, job = self._jobs.popleft()
            if future.set_running_or_notify_cancel():
                _do(job, future)

    def _forget(self, future: Future[Any]) -> None:
        """A cancelled piece goes at once, with the image that it holds."""
        with self._changed:
            self._jobs = deque(job for job in self._jobs if job[0] is not future)


def _do(job: Callable[[], Any], future: Future[Any]) -> None:
    try:
        result = job()
    except Exception as error:  # noqa: BLE001 - whoever waits for it is told
        future.set_exception(error)
    except BaseException:
        future.set_exception(WorkerError("the service has ended"))
        raise
    else:
        future.set_result(result)
