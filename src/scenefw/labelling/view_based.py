"""View-based labelling: every key frame goes through a network, the vertices fuse what it says."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from scenefw.core.errors import ConfigError
from scenefw.core.labels import FROM_VIEWS
from scenefw.labelling.key_frames import EveryNth
from scenefw.labelling.running import (
    KEY_FRAMES,
    begin_heights,
    begin_labels,
    labelled,
    require_classes,
    states_of,
)

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.protocols import HeightMapping, LabelSource, SemanticMapping
    from scenefw.core.types import Frame
    from scenefw.labelling.key_frames import KeyFrames
    from scenefw.labelling.running import Share, States


_REFRESH = 10  # key frames


class ViewBased:
    """Labels views and fuses their labels into the height map (thesis 4.4, 4.7.3).

    Args:
        heights: fuses depth and colour of all frames.
        labels: fuses the labels of key frames.
        source: labels a frame.
        key_frames: which frames are labelled; None = all.
        refresh: label fusion gets a new height map every so many key frames; 0 = never, for
            fusion that reads the frame alone (in height-map space); None = 10 for fusion that reads
            the map, else 0.

    Raises:
        ConfigError: fusion that reads the map gets none.
    """

    def __init__(
        self,
        heights: HeightMapping,
        labels: SemanticMapping,
        source: LabelSource,
        key_frames: KeyFrames | None = None,
        refresh: int | None = None,
    ) -> None:
        reads_map = getattr(labels, "reads_map", False)
        if refresh is None:
            refresh = _REFRESH if reads_map else 0
        if refresh < 0:
            raise ConfigError(f"refresh = {refresh}; expected a number of key frames, 0 = never")
        if reads_map and not refresh:
            raise ConfigError(
                f"refresh = 0, but label fusion in image space reads the height map; give "
                f"labelling.NAME.refresh={_REFRESH}, or null"
            )
        self.heights = heights
        self.labels = labels
        self.source = source
        self.key_frames = key_frames or EveryNth(1)
        self.refresh = refresh

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return tuple(self.source.classes)

    def sharing(self, share: Share) -> ViewBased:
        """The same strategy with each part replaced, for runs side by side on the same frames."""
        return ViewBased(
            share("heights", self.heights),
            share("labels", self.labels),
            share("source", self.source),
            self.key_frames,
            self.refresh,
        )

    def begin(
        self, previous: HeightMap | None = None, states: States | None = None
    ) -> RunningViewBased:
        """Starts a scene, or goes on with a saved one.

        Args:
            previous: the map so far.
            states: as the saved labelling's `states`; with them the map goes on exactly (with
                `refresh`, from a new height map).

        Raises:
            InputError: the map has other classes.
        """
        require_classes(previous, self.classes)
        return RunningViewBased(self, previous, states)


class RunningViewBased:
    """A map whose labels sharpen with every key frame."""

    def __init__(
        self, strategy: ViewBased, previous: HeightMap | None, states: States | None
    ) -> None:
        self.strategy = strategy
        self.heights = begin_heights(strategy.heights, previous, states)
        grid, classes = strategy.heights.grid, len(strategy.classes)
        self.labels = begin_labels(strategy.labels, grid, classes, previous, states)
        self.schedule = strategy.key_frames.begin((states or {}).get(KEY_FRAMES))
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

    def states(self) -> dict[str, dict[str, Any]]:
        """What to save for going on exactly."""
        running = {"heights": self.heights, "labels": self.labels, KEY_FRAMES: self.schedule}
        return states_of(**running)

    def _recent(self) -> HeightMap | None:
        """A height map for label fusion, as old as the strategy allows."""
        every = self.strategy.refresh
        if every and self.key_frames % every == 0:
            self._surface = self.heights.height_map()
        return self._surface
