"""View-based labelling: a network labels every key frame, and the vertices fuse its labels."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from scenefw.core.errors import ConfigError
from scenefw.core.labels import FROM_VIEWS, labelled
from scenefw.labelling.key_frames import EveryNth
from scenefw.labelling.running import HEIGHTS, KEY_FRAMES, LABELS, require_classes, state_of

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.labelling_protocols import (
        HeightMapping,
        KeyFrames,
        LabelSource,
        SemanticMapping,
        States,
    )
    from scenefw.core.types import Frame

_REFRESH = 10  # key frames


@dataclass(frozen=True, eq=False)
class ViewBased:
    """Labels views and fuses their labels into the height map (thesis 4.4, 4.7.3).

    Args:
        heights: fuses depth and colour of all frames.
        labels: fuses the labels of key frames.
        source: labels a frame.
        key_frames: which frames are labelled.
        refresh: label fusion gets a new height map every N key frames; 0 = never, for
            fusion that reads the frame alone (in height-map space); None = 10 for fusion that reads
            the map, else 0.

    Raises:
        ConfigError: fusion that reads the map gets none.
    """

    heights: HeightMapping
    labels: SemanticMapping
    source: LabelSource
    key_frames: KeyFrames = field(default_factory=EveryNth)
    refresh: int | None = None

    def __post_init__(self) -> None:
        if self.refresh is None:
            object.__setattr__(self, "refresh", _REFRESH if self.labels.reads_map else 0)
        if self.refresh is None or self.refresh < 0:
            raise ConfigError(
                f"refresh = {self.refresh}; expected a number of key frames, 0 = never"
            )
        if self.labels.reads_map and not self.refresh:
            raise ConfigError(
                f"refresh = 0, but label fusion in image space reads the height map; give "
                f"labelling.NAME.refresh={_REFRESH}, or null"
            )

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return tuple(self.source.classes)

    def begin(
        self, previous: HeightMap | None = None, states: States | None = None
    ) -> RunningViewBased:
        """Starts a scene or resumes a saved one.

        Args:
            previous: the map so far.
            states: of the saved labelling; with them the map is resumed exactly (with `refresh`,
                from a new height map).

        Raises:
            InputError: the map has other classes.
        """
        require_classes(previous, self.classes)
        return RunningViewBased(self, previous, states)


class RunningViewBased:
    """A map whose labels are refined with every key frame."""

    def __init__(
        self, strategy: ViewBased, previous: HeightMap | None, states: States | None
    ) -> None:
        self.strategy = strategy
        self.heights = strategy.heights.begin(previous, state_of(HEIGHTS, states))
        self.labels = strategy.labels.begin(
            strategy.heights.grid,
            len(strategy.classes),
            None if previous is None else previous.probabilities,
            state_of(LABELS, states),
        )
        self.schedule = strategy.key_frames.begin(state_of(KEY_FRAMES, states))
        self.key_frames = 0
        self._surface: HeightMap | None = None

    def add(self, frame: Frame) -> None:
        """Fuses the frame's geometry, and its labels if it is a key frame."""
        self.heights.add(frame)
        if not self.schedule.takes(frame):
            return
        probabilities = self.strategy.source.label(frame)
        self.labels.add(probabilities, frame, self._recent())
        self.key_frames += 1

    def height_map(self) -> HeightMap:
        """The map so far; vertices that no labelled view showed are unknown."""
        probabilities = self.labels.probabilities()
        classes = self.strategy.classes
        return labelled(self.heights.height_map(), probabilities, classes, FROM_VIEWS)

    def states(self) -> States:
        """The state to resume from exactly."""
        return {
            HEIGHTS: self.heights.state(),
            LABELS: self.labels.state(),
            KEY_FRAMES: self.schedule.state(),
        }

    def _recent(self) -> HeightMap | None:
        """A height map for label fusion, as old as the strategy allows."""
        interval = self.strategy.refresh
        if interval and self.key_frames % interval == 0:
            self._surface = self.heights.height_map()
        return self._surface
