"""Time of each stage and memory of labelling (thesis table 4.2)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch

from scenefw.core.errors import ConfigError
from scenefw.learning.costs import peak_memory
from scenefw_labelling_studies.measures import of_times
from scenefw_labelling_studies.shared_parts import LOADING, MAP_NETWORK, STAGES, VIEW_NETWORK

if TYPE_CHECKING:
    from scenefw.core.measures import Measure
    from scenefw_labelling_studies.bench import Bench

Tracker = Callable[[Sequence[int], str], Iterable[int]]

_PER_CALL = (VIEW_NETWORK, MAP_NETWORK)  # the other stages are averages per frame
_MEGABYTE = 1e6


@dataclass(frozen=True)
class TimesResult:
    """Times and memory.

    Args:
        milliseconds: per strategy and stage; networks per pass, other stages per frame.
        per_frame: milliseconds of processing per frame and strategy, without loading.
        memory: peak of the process and, where one is used, of the GPU (MB).
        scenes: number of scenes.
        frames: of each.
        device: what it ran on, in words.
    """

    milliseconds: Mapping[str, Mapping[str, float]]
    per_frame: Mapping[str, float]
    memory: Mapping[str, float]
    scenes: int
    frames: int
    device: str

    @property
    def figures(self) -> dict[str, float]:
        """All of them, times as `<strategy>/<stage> ms`."""
        return self._costs() | {"scenes": self.scenes, "frames": self.frames}

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits and published values of the figures."""
        return of_times(self._costs())

    def _costs(self) -> dict[str, float]:
        times = {
            f"{strategy}/{stage} ms": value
            for strategy, stages in self.milliseconds.items()
            for stage, value in stages.items()
        }
        totals = {f"{name}/per frame ms": value for name, value in self.per_frame.items()}
        memory = {f"memory of {name} MB": value for name, value in self.memory.items()}
        return times | totals | memory


class LabellingTimes:
    """Times the strategies on the frames of test scenes, after a warm-up that isn't counted.

    Args:
        bench: runs the strategies.
        frames: of each sequence.
        scenes: how many; None = all.
        device: that of the networks.
    """

    def __init__(
        self, bench: Bench, frames: int, scenes: int | None = None, device: str = "cpu"
    ) -> None:
        if frames < 1:
            raise ConfigError(f"frames = {frames}; expected 1 or more")
        self.bench = bench
        self.frames = frames
        self.scenes = scenes
        self.device = torch.device(device)

    def run(self, track: Tracker = lambda scenes, _: scenes) -> TimesResult:
        """Means over scenes; `track` wraps the loop in a progress bar."""
        self.bench.warm_up()
        number = min(self.scenes or len(self.bench.scenes), len(self.bench.scenes))
        seconds: dict[str, Counter[str]] = {name: Counter() for name in self.bench.strategies}
        calls: dict[str, Counter[str]] = {name: Counter() for name in self.bench.strategies}
        for scene in track(range(number), "scenes"):
            (snapshots,) = self.bench.run(scene, [self.frames])
            for name, snapshot in snapshots.items():
                seconds[name].update(snapshot.seconds)
                calls[name].update(snapshot.calls)
        frames = number * self.frames
        processing = {
            n: sum(stage_seconds.values()) - stage_seconds[LOADING]
            for n, stage_seconds in seconds.items()
        }
        return TimesResult(
            {
                n: _milliseconds(stage_seconds, calls[n], frames)
                for n, stage_seconds in seconds.items()
            },
            {name: 1000 * total / frames for name, total in processing.items()},
            _memory(self.device),
            number,
            self.frames,
            _name(self.device),
        )


def _memory(device: torch.device) -> dict[str, float]:
    """Most memory (MB) that the process has held so far, and that torch has held on the GPU."""
    devices = {"process": torch.device("cpu"), **({"GPU": device} if device.type == "cuda" else {})}
    return {name: peak_memory(where) / _MEGABYTE for name, where in devices.items()}


def _name(device: torch.device) -> str:
    """The GPU's name, or the number of the CPU's threads."""
    if device.type == "cuda":
        return str(torch.cuda.get_device_name(device))
    return f"CPU, {torch.get_num_threads()} threads"


def _milliseconds(
    seconds: Mapping[str, float], calls: Mapping[str, int], frames: int
) -> dict[str, float]:
    order = [stage for stage in STAGES if stage in seconds]
    order += [stage for stage in seconds if stage not in STAGES]
    return {
        stage: 1000 * seconds[stage] / (calls[stage] if stage in _PER_CALL else frames)
        for stage in order
    }
