"""Fusion and label sources that strategies share while they run side by side on one scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from scenefw.core.errors import ConfigError
from scenefw.evaluation.labelling.stopwatch import OTHER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.height_maps import HeightGrid, HeightMap
    from scenefw.core.protocols import (
        HeightMapping,
        LabelSource,
        MapLabelSource,
        RunningHeights,
        RunningLabels,
        SemanticMapping,
    )
    from scenefw.core.types import Float32, Frame
    from scenefw.evaluation.labelling.bench import SharingLabelling
    from scenefw.evaluation.labelling.stopwatch import SharedWork

LOADING = "data loading"
RECONSTRUCTION = "reconstruction"
VIEW_NETWORK = "network, one view"
FUSION = "semantic fusion"
MAP_NETWORK = "network, whole map"
STAGES = (LOADING, RECONSTRUCTION, VIEW_NETWORK, FUSION, MAP_NETWORK, OTHER)
"""What seconds are counted for."""


class SharedParts:
    """One wrapper per kind of part; every strategy that names the kind gets the same one.

    Args:
        work: does the work once per turn.
    """

    def __init__(self, work: SharedWork) -> None:
        self.work = work
        self._wrapped: dict[str, Any] = {}

    def share(self, kind: str, part: Any) -> Any:
        """The wrapper of a kind of part; made of the first part that is given."""
        if kind not in self._wrapped:
            self._wrapped[kind] = _WRAPPERS[kind](part, self.work)
        return self._wrapped[kind]


def require_alike(strategies: Mapping[str, SharingLabelling]) -> None:
    """Finds out before any work whether strategies can share theirs.

    Raises:
        ConfigError: parts of one kind differ in settings or weights.
    """
    first: dict[str, tuple[str, Any]] = {}
    for name, strategy in strategies.items():

        def compare(kind: str, part: Any, name: str = name) -> Any:
            owner, other = first.setdefault(kind, (name, part))
            if not alike(other, part):
                raise ConfigError(
                    f"{owner} and {name} share their work while they are compared, but their "
                    f"{_KINDS[kind]} differ in settings; give both the same, or evaluate them one "
                    f"by one (labelling=[{name}])"
                )
            return part

        strategy.sharing(compare)


def alike(one: Any, other: Any) -> bool:
    """Whether two parts are of one class, with equal settings and weights."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, torch.nn.Module):
        return alike(one.state_dict(), other.state_dict())
    if isinstance(one, torch.Tensor):
        return torch.equal(one, other)
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(alike(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(alike, one, other))
    if type(one).__eq__ is object.__eq__ and hasattr(one, "__dict__"):
        return alike(vars(one), vars(other))
    return bool(one == other)


class _Heights:
    """Height fusion of one scene: whoever begins gets the same map."""

    def __init__(self, part: HeightMapping, work: SharedWork) -> None:
        self.grid: HeightGrid = part.grid
        self.work = work
        self.running = part.begin()

    def begin(self, previous: HeightMap | None = None) -> RunningHeights:
        return self

    def add(self, frame: Frame) -> None:
        self.work.do(RECONSTRUCTION, "frame", lambda: self.running.add(frame))

    def height_map(self) -> HeightMap:
        return self.work.do(RECONSTRUCTION, "map", self.running.height_map)


class _Labels:
    """Label fusion of one scene; all who use it must fuse the same key frames."""

    def __init__(self, part: SemanticMapping, work: SharedWork) -> None:
        self.part = part
        self.work = work
        self.running: RunningLabels | None = None
        self.turns: list[int] = []

    def begin(
        self, grid: HeightGrid, classes: int, previous: Float32 | None = None
    ) -> RunningLabels:
        self.running = self.running or self.part.begin(grid, classes)
        return _LabelsOfOne(self, self.running)


class _LabelsOfOne:
    """What one strategy sees of the shared label fusion."""

    def __init__(self, shared: _Labels, running: RunningLabels) -> None:
        self.shared, self.running = shared, running
        self.turns: list[int] = []

    def add(self, probabilities: Float32, frame: Frame, heights: HeightMap | None) -> None:
        def fuse() -> None:
            self.running.add(probabilities, frame, heights)
            self.shared.turns.append(self.shared.work.turn)

        self.shared.work.do(FUSION, "frame", fuse)
        self.turns.append(self.shared.work.turn)

    def probabilities(self) -> Float32:
        if self.turns != self.shared.turns:
            raise ConfigError(
                "strategies that are compared have different key frames; give all the same "
                "key_frames, or evaluate them one by one (labelling=[...])"
            )
        return self.shared.work.do(FUSION, "map", self.running.probabilities)


class _Source:
    def __init__(self, part: LabelSource, work: SharedWork) -> None:
        self.part, self.work = part, work
        self.classes: Sequence[str] = part.classes

    def label(self, frame: Frame) -> Float32:
        return self.work.do(VIEW_NETWORK, "frame", lambda: self.part.label(frame))


class _MapSource:
    def __init__(self, part: MapLabelSource, work: SharedWork) -> None:
        self.part, self.work = part, work
        self.classes: Sequence[str] = part.classes

    def label_map(self, height_map: HeightMap) -> Float32:
        return self.work.do(MAP_NETWORK, "map", lambda: self.part.label_map(height_map))


_KINDS = {
    "heights": "height fusion",
    "labels": "label fusion",
    "source": "labels of views",
    "map_source": "labels of maps",
}
_WRAPPERS: dict[str, Any] = {
    "heights": _Heights,
    "labels": _Labels,
    "source": _Source,
    "map_source": _MapSource,
}
