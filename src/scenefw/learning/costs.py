"""What a training costs: samples per second, memory, time that the network waits for data."""

import dataclasses
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

import torch

_AHEAD = 2  # steps that the host may be ahead of the device, with their batches in memory

Batch = TypeVar("Batch")


class StepTimes:
    """Splits the time of steps into waiting for data and the network's, on the device's clock.

    On CUDA events mark the network's stream; they are read two steps later, so that the host only
    waits for what is long done, and is never more than two steps ahead.
    """

    def __init__(self) -> None:
        self.data = self.network = 0.0
        self._marks: list[Any] = []
        self._open: deque[list[Any]] = deque()

    @property
    def share_of_data(self) -> float:
        """Share of the steps' time in which the network had no data yet."""
        return self.data / max(self.data + self.network, 1e-9)

    def begin(self, device: torch.device) -> None:
        """A step begins."""
        self._collect(_AHEAD - 1)
        self._marks = [_mark(device)]

    def mark_data(self, device: torch.device) -> None:
        """Its data are there."""
        self._marks.append(_mark(device))

    def end(self, device: torch.device) -> None:
        """Its weights are updated."""
        if len(self._marks) == 2:
            self._open.append([*self._marks, _mark(device)])
            self._marks = []
        self._collect(_AHEAD)

    def finish(self) -> None:
        """Reads all remaining times, waiting for the device."""
        self._collect(0)

    def _collect(self, max_open: int) -> None:
        while len(self._open) > max_open:
            start_mark, data_mark, end_mark = self._open.popleft()
            self.data += _between(start_mark, data_mark)
            self.network += _between(data_mark, end_mark)


class SideStream:
    """On CUDA, a stream beside the network's: work in it does not wait for the network."""

    def __init__(self) -> None:
        self._stream: Any = None

    def run(self, device: torch.device, make: Callable[[], Batch]) -> Batch:
        """What `make` makes, a dataclass of tensors and mappings of them, ready for the network."""
        if device.type != "cuda":
            return make()
        if self._stream is None:
            self._stream = torch.cuda.Stream(device)
        main = torch.cuda.current_stream(device)
        with torch.cuda.stream(self._stream):
            batch = make()
        main.wait_stream(self._stream)
        for tensor in _tensors(batch):
            tensor.record_stream(main)  # its memory is not reused before the network has read it
        return batch


def _tensors(batch: Any) -> Iterator[torch.Tensor]:
    """Those that are fields of a dataclass, or in mappings there."""
    for field in dataclasses.fields(batch):
        value = getattr(batch, field.name)
        for item in value.values() if isinstance(value, Mapping) else [value]:
            if isinstance(item, torch.Tensor):
                yield item


def peak_memory(device: torch.device) -> float:
    """Most memory used so far (bytes): by tensors on a GPU, by this process on a CPU."""
    if device.type == "cuda":
        return float(torch.cuda.max_memory_allocated(device))
    try:
        import resource
    except ImportError:  # not on Windows
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak) * (1 if sys.platform == "darwin" else 1024)


def _mark(device: torch.device) -> Any:
    if device.type != "cuda":
        return time.perf_counter()
    event = torch.cuda.Event(enable_timing=True)
    event.record(torch.cuda.current_stream(device))
    return event


def _between(first: Any, second: Any) -> float:
    """Seconds."""
    if isinstance(first, float):
        return second - first
    second.synchronize()
    return first.elapsed_time(second) / 1e3
