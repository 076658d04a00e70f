"""Processes of a Dask cluster, on one machine or many."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from scenefw.core.errors import ConfigError, MissingDependencyError, WorkerError

Item = TypeVar("Item")
Result = TypeVar("Result")


class Dask:
    """Work on the workers of a Dask scheduler.

    It is given to Dask itself: joblib's dask backend works in this process where a cluster has one
    worker. Work of a worker that is lost is done again by the others. All machines need the same
    environment, and folders that a task writes to must be the same on all of them.

    Args:
        address: of the scheduler, as "tcp://host:8786"; None starts workers on this machine.
        workers: processes if there is no address; -1 = one per core.
        timeout: seconds to wait for the scheduler and its first worker.

    Raises:
        ConfigError: `workers` is 0, or `timeout` is not positive.
    """

    def __init__(
        self, address: str | None = None, workers: int = -1, timeout: float = 30.0
    ) -> None:
        if workers == 0:
            raise ConfigError(
                "parallel.workers = 0: expected a number of processes, or -1 for all cores"
            )
        if not timeout > 0:
            raise ConfigError(f"parallel.timeout = {timeout}: expected seconds, above 0")
        self.address, self.workers, self.timeout = address, workers, timeout

    def each(
        self, work: Callable[[Item], Result], items: Sequence[Item], *, ordered: bool = True
    ) -> Iterator[Result]:
        """Results as they are done.

        Raises:
            ConfigError: no scheduler answers, or it has no workers.
            MissingDependencyError: Dask is not installed.
            WorkerError: a piece of work was on several workers when they were lost.
        """
        try:
            from distributed import KilledWorker, as_completed
        except ImportError as error:
            raise MissingDependencyError(
                'parallel=dask needs Dask; install it with: pip install "scenefw[dask]"'
            ) from error
        with self._client() as client:
            futures = client.map(work, list(items), pure=False)
            try:
                for future in futures if ordered else as_completed(futures):
                    yield future.result()
                    future.release()
            except KilledWorker as error:
                raise WorkerError(
                    "Dask gave up on a piece of work whose workers were lost, perhaps for lack of "
                    "memory; start again with fewer workers per machine: what is finished is kept "
                    "where the task keeps it"
                ) from error

    @contextmanager
    def _client(self) -> Iterator[Any]:
        """A client of the scheduler at the address, or of one for this block."""
        from distributed import Client, LocalCluster

        if self.address is None:
            count = None if self.workers < 0 else self.workers
            with (
                LocalCluster(
                    n_workers=count, threads_per_worker=1, dashboard_address=None
                ) as cluster,
                Client(cluster) as client,
            ):
                yield client
            return
        try:
            client = Client(self.address, timeout=self.timeout)
        except (OSError, ValueError) as error:
            raise ConfigError(
                f"no Dask scheduler at {self.address}; start one with `dask scheduler`, or give "
                "parallel.address=tcp://HOST:PORT of one that runs"
            ) from error
        with client:
            yield client
