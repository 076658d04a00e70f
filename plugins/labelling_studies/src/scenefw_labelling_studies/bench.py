"""Labelling strategies run side by side on the same frames of the same scenes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from scenefw.core.errors import ConfigError, InputError
from scenefw.noise.frames import disturb
from scenefw_labelling_studies.shared_parts import LOADING, SharedParts
from scenefw_labelling_studies.stopwatch import SharedWork

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.labelling_protocols import FrameSource, Labelling, RunningLabelling
    from scenefw.core.protocols import Noise
    from scenefw.core.types import Frame


@dataclass(frozen=True)
class Snapshot:
    """A strategy's map after some frames.

    Args:
        frames: number of frames that made it.
        height_map: with labels.
        seconds: by stage: what it takes to have this map if it is requested once.
        calls: by stage: how many pieces of work these seconds are of.
    """

    frames: int
    height_map: HeightMap
    seconds: Mapping[str, float]
    calls: Mapping[str, int] = field(default_factory=dict)

    @property
    def processing(self) -> float:
        """Seconds of all stages but loading the data (as in the thesis's figure 4.24)."""
        return sum(time for stage, time in self.seconds.items() if stage != LOADING)


class Bench:
    """Feeds the frames of a scene to all strategies; shared work is done once.

    Args:
        scenes: views and truth.
        strategies: by name.
        noise: disturbs the frames that strategies see, by name.
        seed: of the noise.

    Raises:
        ConfigError: no strategy, or other classes than the scenes'.
    """

    def __init__(
        self,
        scenes: FrameSource,
        strategies: Mapping[str, Labelling],
        noise: Mapping[str, Noise] | None = None,
        seed: int = 0,
    ) -> None:
        if not strategies:
            raise ConfigError("no strategy to run; give labelling=[view_based,map_based,hybrid]")
        for name, strategy in strategies.items():
            if tuple(strategy.classes) != tuple(scenes.classes):
                raise ConfigError(
                    f"{name} labels {', '.join(strategy.classes)}, the scenes contain "
                    f"{', '.join(scenes.classes)}; give checkpoints of these classes"
                )
        self.scenes = scenes
        self.strategies = dict(strategies)
        self.noise = dict(noise or {})
        self.seed = seed

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return tuple(self.scenes.classes)

    def warm_up(self) -> None:
        """Runs one frame that does not count, so that no strategy is charged for compiling."""
        list(self.run(0, [1]))

    def run(
        self, scene: int, counts: Sequence[int], noise: Mapping[str, Noise] | None = None
    ) -> Iterator[dict[str, Snapshot]]:
        """Snapshots of all strategies after each of these numbers of frames.

        Args:
            scene: number of the scene.
            counts: numbers of frames, ascending.
            noise: in place of the bench's own.
        """
        work = SharedWork()
        parts = SharedParts(work)
        running = {
            name: parts.shared(strategy).begin() for name, strategy in self.strategies.items()
        }
        noises = self.noise if noise is None else noise
        frames = self._frames(scene, max(counts), noises)
        for index in range(max(counts)):
            work.begin_turn(index)
            for name, labelling in running.items():
                with work.of(name):
                    labelling.add(work.do(LOADING, "frame", lambda: _next(frames, scene)))
            if index + 1 in counts:
                yield {name: _snapshot(name, running[name], index + 1, work) for name in running}

    def _frames(self, scene: int, count: int, noise: Mapping[str, Noise]) -> Iterator[Frame]:
        for index, frame in enumerate(self.scenes.frames(scene, count)):
            yield disturb(frame, noise, self.seed, scene, index)


def _next(frames: Iterator[Frame], scene: int) -> Frame:
    frame = next(frames, None)
    if frame is None:
        raise InputError(f"scene {scene} has fewer frames than requested; give a lower size.frames")
    return frame


def _snapshot(name: str, running: RunningLabelling, count: int, work: SharedWork) -> Snapshot:
    request = f"{name} after {count} frames"
    with work.of(request):
        height_map = running.height_map()
    seconds, calls = Counter(work.spent(name)), Counter(work.calls(name))
    seconds.update(work.spent(request))
    calls.update(work.calls(request))
    return Snapshot(count, height_map, dict(seconds), dict(calls))
