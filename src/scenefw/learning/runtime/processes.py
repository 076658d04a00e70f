"""Several processes of one training on one machine, which start and end together."""

import multiprocessing
import os
import pickle
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing import connection
from typing import Any

import torch
from lightning.fabric.plugins.environments.lightning import find_free_network_port

from scenefw.core.errors import ConfigError, SceneFWError, TrainingError
from scenefw.kernels.threads import threads

_RANK = "LOCAL_RANK"
_GRACE = 20.0  # seconds in which this process should notice by itself that another one failed


@contextmanager
def processes(count: int, work: Callable[[], Any]) -> Iterator[None]:
    """Has `count - 1` new processes do `work`, while the caller does its own share as the first.

    The new ones are told their rank by the variables that torch.distributed reads, are silent, and
    end with the caller. Where something else started all processes (torchrun, a cluster), none is
    added.

    Args:
        count: processes, the caller's included.
        work: what the others do; it is pickled.

    Raises:
        TrainingError: another process failed.
        ConfigError: the work can't be pickled.
    """
    if count == 1 or _RANK in os.environ:
        yield
        return
    common = {
        "MASTER_ADDR": "127.0.0.1",
        "MASTER_PORT": str(find_free_network_port()),
        "WORLD_SIZE": str(count),
        "NODE_RANK": "0",
    }
    count_each = max(torch.get_num_threads() // count, 1)  # thread pools must not multiply
    packed = _packed(work)
    with _variables({**common, _RANK: "0"}), threads(count_each):
        workers = Workers(
            [_start({**common, _RANK: str(n)}, count_each, packed) for n in range(1, count)]
        )
        try:
            yield
            workers.join()
        except Exception as error:
            reason = None if isinstance(error, SceneFWError) else workers.reason(time.time())
            if reason is None:
                raise
            raise TrainingError(reason) from error
        finally:
            workers.end()
            if torch.distributed.is_initialized():
                torch.distributed.destroy_process_group()


class Workers:
    """The other processes of a training.

    If one fails and this process does not notice, as it waits for its part of a sum on a GPU, then
    this process ends, too.

    Args:
        started: processes, each with the pipe on which it tells of its failure.
    """

    def __init__(self, started: list[tuple[Any, Any]]) -> None:
        self._started = started
        self._over = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def join(self) -> None:
        """Waits until all are done.

        Raises:
            TrainingError: one failed.
        """
        for process, _ in self._started:
            process.join()
        reason = self.reason(time.time())
        if reason is not None:
            raise TrainingError(reason)

    def reason(self, before: float) -> str | None:
        """One line on the process that failed first, if one did before a time (s since 1970)."""
        failures = []
        for rank, (process, pipe) in enumerate(self._started, 1):
            where = f"process {rank} of {len(self._started) + 1} failed"
            if pipe.poll():
                when, words = self._tale(pipe)
                failures.append((when, f"{where}: {words}"))
            elif process.exitcode:
                failures.append((before - 1, f"{where}: it ended with status {process.exitcode}"))
        when, words = min(failures, default=(before, ""))
        return words if when < before else None

    def end(self) -> None:
        """Ends those that still run."""
        self._over.set()
        for process, _ in self._started:
            if process.is_alive():
                process.kill()
            process.join()

    def _tale(self, pipe: Any) -> tuple[float, str]:
        try:
            return pipe.recv()
        except EOFError:  # closed without a message: it is done, or was killed
            return float("inf"), ""

    def _watch(self) -> None:
        running_processes = [process for process, _ in self._started]
        while running_processes and not self._over.is_set():
            connection.wait([process.sentinel for process in running_processes], timeout=1.0)
            running_processes = [
                process for process in running_processes if process.exitcode is None
            ]
            if any(process.exitcode for process, _ in self._started):
                break
        else:
            return
        now = time.time()
        if not self._over.wait(_GRACE):
            print(f"error: {self.reason(now + 1)}", file=sys.stderr, flush=True)
            for process, _ in self._started:
                process.kill()
            os._exit(2)


def _packed(work: Callable[[], Any]) -> bytes:
    """A copy of the work; without it, torch would share the memory of its tensors."""
    try:
        return pickle.dumps(work)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise ConfigError(
            f"this training can't be copied to other processes ({error}); give trainer.devices=1, "
            "or start its processes with torchrun"
        ) from error


def _start(variables: Mapping[str, str], count: int, packed: bytes) -> tuple[Any, Any]:
    context = multiprocessing.get_context("spawn")
    reader, writer = context.Pipe(duplex=False)
    process = context.Process(target=_run, args=(dict(variables), count, writer, packed))
    process.start()
    writer.close()
    return process, reader


def _run(variables: Mapping[str, str], count: int, pipe: Any, packed: bytes) -> None:
    """The work of another process."""
    os.environ.update(variables)
    threading.Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123 - a device
        sys.stdout = sys.stderr = nowhere
        try:
            with threads(count):
                pickle.loads(packed)()
        except BaseException as error:  # noqa: BLE001 - whatever it is, the first process tells
            words = " ".join(str(error).split())[:500]
            named = isinstance(error, SceneFWError)
            pipe.send((time.time(), words if named else f"{type(error).__name__}: {words}"))
            pipe.close()
            os._exit(1)


def _end_with_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


@contextmanager
def _variables(values: Mapping[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)  # torch's own end may have removed it
            if value is not None:
                os.environ[name] = value
