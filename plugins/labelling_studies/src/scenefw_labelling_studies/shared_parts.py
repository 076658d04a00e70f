"""Fusion and label sources that strategies share while they run side by side on one scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from scenefw.core.errors import ConfigError
from scenefw.core.labelling_protocols import (
    HeightMapping,
    LabelSource,
    MapLabelSource,
    RunningHeights,
    RunningLabels,
    SemanticMapping,
)
from scenefw_labelling_studies.stopwatch import OTHER

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

    from scenefw.core.height_maps import HeightGrid, HeightMap
    from scenefw.core.labelling_protocols import Labelling, State
    from scenefw.core.types import Float32, Frame
    from scenefw_labelling_studies.stopwatch import SharedWork

LOADING = "data loading"
RECONSTRUCTION = "reconstruction"
VIEW_NETWORK = "network, one view"
FUSION = "semantic fusion"
MAP_NETWORK = "network, whole map"
STAGES = (LOADING, RECONSTRUCTION, VIEW_NETWORK, FUSION, MAP_NETWORK, OTHER)
"""What seconds are counted for."""

Running = TypeVar("Running", bound=RunningHeights | RunningLabels)
Value = TypeVar("Value")


class SharedParts:
    """Lets strategies that hold the same parts share their work on one scene.

    Args:
        work: does the work once per turn.
    """

    def __init__(self, work: SharedWork) -> None:
        self.work = work
        self._running: dict[Hashable, _Shared[Any]] = {}

    def shared(self, strategy: Labelling) -> Labelling:
        """The strategy with its parts replaced by shared ones; itself if it is not a dataclass.

        Two strategies share what they hold the very same object of.
        """
        if not is_dataclass(strategy) or isinstance(strategy, type):
            return strategy
        parts = {f.name: self._wrapped(getattr(strategy, f.name)) for f in fields(strategy)}
        return replace(strategy, **{name: part for name, part in parts.items() if part is not None})

    def running(
        self, part: object, settings: Hashable, stage: str, begin: Callable[[], Running]
    ) -> _Shared[Running]:
        """The running part shared by all strategies that begin it with the same settings."""
        key = (id(part), settings)
        if key not in self._running:
            self._running[key] = _Shared(begin(), self.work, stage)
        return self._running[key]

    def _wrapped(self, part: object) -> object | None:
        """The replacement of a part in one strategy; None if the part isn't shared."""
        if isinstance(part, HeightMapping):
            return _Heights(part, self)
        if isinstance(part, SemanticMapping):
            return _Labels(part, self)
        if isinstance(part, LabelSource) and isinstance(part, MapLabelSource):
            return _BothSources(part, self.work)
        if isinstance(part, LabelSource):
            return _Source(part, self.work)
        return _MapSource(part, self.work) if isinstance(part, MapLabelSource) else None


class _Shared(Generic[Running]):
    """A running part and the record of its calls: turn and identity of the inputs."""

    def __init__(self, running: Running, work: SharedWork, stage: str) -> None:
        self.running, self.work, self.stage = running, work, stage
        self.fed: list[tuple[int, ...]] = []


class _View(Generic[Running]):
    """One strategy's view of a shared running part.

    Raises:
        ConfigError: strategies feed the part with something else, so that they can't share it.
    """

    def __init__(self, shared: _Shared[Running]) -> None:
        self._shared = shared
        self._fed: list[tuple[int, ...]] = []

    def _feed(self, add: Callable[[], None], *inputs: object) -> None:
        shared, number = self._shared, len(self._fed)
        self._fed.append((shared.work.turn, *map(id, inputs)))
        if number == len(shared.fed):
            shared.fed.append(self._fed[-1])
        if shared.fed[number] != self._fed[-1]:
            raise _unlike(shared.stage)
        shared.work.do(shared.stage, (id(shared), number), add, inputs)

    def _read(self, name: str, compute: Callable[[], Value]) -> Value:
        shared, number = self._shared, len(self._fed)
        if shared.fed != self._fed:
            raise _unlike(shared.stage)
        return shared.work.do(shared.stage, (id(shared), number, name), compute)

    def state(self) -> State:
        return self._shared.running.state()


def _unlike(stage: str) -> ConfigError:
    return ConfigError(
        f"strategies that are compared share their {stage}, but feed it different frames or "
        "labels; give all the same label_source, key_frames and refresh, or evaluate them one by "
        "one (labelling=[NAME])"
    )


class _Heights:
    """Height fusion of one strategy."""

    def __init__(self, part: HeightMapping, parts: SharedParts) -> None:
        self.part, self.parts, self.begun = part, parts, 0

    @property
    def grid(self) -> HeightGrid:
        return self.part.grid

    def begin(
        self, previous: HeightMap | None = None, state: State | None = None
    ) -> RunningHeights:
        if previous is not None or state is not None:
            return self.part.begin(previous, state)
        self.begun += 1
        return _HeightsView(
            self.parts.running(self.part, self.begun, RECONSTRUCTION, self.part.begin)
        )


class _HeightsView(_View[RunningHeights]):
    def add(self, frame: Frame) -> None:
        self._feed(lambda: self._shared.running.add(frame), frame)

    def height_map(self) -> HeightMap:
        return self._read("map", self._shared.running.height_map)


class _Labels:
    """Label fusion of one strategy."""

    def __init__(self, part: SemanticMapping, parts: SharedParts) -> None:
        self.part, self.parts, self.begun = part, parts, 0

    @property
    def reads_map(self) -> bool:
        return self.part.reads_map

    def begin(
        self,
        grid: HeightGrid,
        classes: int,
        previous: Float32 | None = None,
        state: State | None = None,
    ) -> RunningLabels:
        if previous is not None or state is not None:
            return self.part.begin(grid, classes, previous, state)
        self.begun += 1
        settings = (self.begun, grid, classes)
        running = self.parts.running(
            self.part, settings, FUSION, lambda: self.part.begin(grid, classes)
        )
        return _LabelsView(running, reads_map=self.part.reads_map)


class _LabelsView(_View[RunningLabels]):
    def __init__(self, shared: _Shared[RunningLabels], *, reads_map: bool) -> None:
        super().__init__(shared)
        self.reads_map = reads_map

    def add(self, probabilities: Float32, frame: Frame, heights: HeightMap | None) -> None:
        def fuse() -> None:
            self._shared.running.add(probabilities, frame, heights)

        self._feed(fuse, probabilities, frame, *([heights] if self.reads_map else []))

    def probabilities(self) -> Float32:
        return self._read("map", self._shared.running.probabilities)


class _Source:
    def __init__(self, part: LabelSource, work: SharedWork) -> None:
        self.part, self.work = part, work

    @property
    def classes(self) -> Sequence[str]:
        return self.part.classes

    def label(self, frame: Frame) -> Float32:
        return self.work.do(VIEW_NETWORK, id(self.part), lambda: self.part.label(frame), (frame,))


class _MapSource:
    def __init__(self, part: MapLabelSource, work: SharedWork) -> None:
        self.map_part, self.work = part, work

    @property
    def classes(self) -> Sequence[str]:
        return self.map_part.classes

    def label_map(self, height_map: HeightMap) -> Float32:
        m = height_map
        inputs = (m.heights, m.colour, m.confidence, m.variance)  # the same for all labels
        work = self.work
        return work.do(MAP_NETWORK, id(self.map_part), lambda: self.map_part.label_map(m), inputs)


class _BothSources(_Source, _MapSource):
    """One object that labels views and maps."""

    def __init__(self, part: Any, work: SharedWork) -> None:
        _Source.__init__(self, part, work)
        _MapSource.__init__(self, part, work)
