"""Processes of this machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from scenefw.core.errors import ConfigError, WorkerError

Item = TypeVar("Item")
Result = TypeVar("Result")


class Local:
    """Work in several processes of this machine (joblib's loky).

    Args:
        workers: processes; -1 = one per core. One works in this process.

    Raises:
        ConfigError: `workers` is 0.
    """

    def __init__(self, workers: int = -1) -> None:
        if workers == 0:
            raise ConfigError(
                "parallel.workers = 0: expected a number of processes, or -1 for all cores"
            )
        self.workers = workers

    def each(
        self, work: Callable[[Item], Result], items: Sequence[Item], *, ordered: bool = True
    ) -> Iterator[Result]:
        """Results as they are done.

        Raises:
            WorkerError: a process was killed.
        """
        if self.workers == 1 or len(items) < 2:
            yield from map(work, items)
            return
        from joblib import Parallel, delayed
        from joblib.externals.loky.process_executor import TerminatedWorkerError

        come = "generator" if ordered else "generator_unordered"
        pool = Parallel(n_jobs=self.workers, backend="loky", return_as=come, max_nbytes=None)
        try:
            yield from pool(delayed(work)(item) for item in items)
        except TerminatedWorkerError as error:
            raise WorkerError(
                "a worker process was killed, perhaps for lack of memory; start again, with fewer "
                "parallel.workers if so: what is finished is kept where the task keeps it"
            ) from error
