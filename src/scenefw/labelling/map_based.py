"""Map-based labelling: geometry and colour are fused first, the map is labelled as a whole."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from scenefw.core.errors import ConfigError
from scenefw.core.labels import FROM_MAP
from scenefw.labelling.running import (
    MAP_LABELS,
    MapLabels,
    begin_heights,
    labelled,
    require_classes,
    states_of,
    unlabelled,
)

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.protocols import HeightMapping, MapLabelSource
    from scenefw.core.types import Frame
    from scenefw.labelling.running import Share, States


class MapBased:
    """Labels the fused height map (thesis 4.7.4).

    Args:
        heights: fuses depth and colour of all frames.
        map_source: labels a height map.
        every: the map is labelled at every so many frames; None = whenever it is asked for, so
            once at the end if it is asked for once.
        coverage: least share of vertices seen; before, all are unknown. The thesis waits until
            the scene is covered, so that the network sees no half-empty map.
    """

    def __init__(
        self,
        heights: HeightMapping,
        map_source: MapLabelSource,
        every: int | None = None,
        coverage: float = 0.0,
    ) -> None:
        if every is not None and every < 1:
            raise ConfigError(f"every = {every}; expected a number of frames, or null")
        if not 0 <= coverage <= 1:
            raise ConfigError(f"coverage = {coverage}; expected a share from 0 to 1")
        self.heights = heights
        self.map_source = map_source
        self.every = every
        self.coverage = coverage

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return tuple(self.map_source.classes)

    def sharing(self, share: Share) -> MapBased:
        """The same strategy with each part replaced, for runs side by side on the same frames."""
        return MapBased(
            share("heights", self.heights),
            share("map_source", self.map_source),
            self.every,
            self.coverage,
        )

    def begin(
        self, previous: HeightMap | None = None, states: States | None = None
    ) -> RunningMapBased:
        """Starts a scene, or goes on with a saved one (exactly, if its states are given).

        Raises:
            InputError: the map has other classes.
        """
        require_classes(previous, self.classes)
        return RunningMapBased(self, previous, states)


class RunningMapBased:
    """A map that grows, and is labelled when it is time."""

    def __init__(
        self, strategy: MapBased, previous: HeightMap | None, states: States | None
    ) -> None:
        self.strategy = strategy
        self.heights = begin_heights(strategy.heights, previous, states)
        self.labels = MapLabels(strategy.every, states)
        self._before = previous

    def add(self, frame: Frame) -> None:
        """Fuses the frame; labels the map if its frame has come."""
        self.heights.add(frame)
        if self.labels.due():
            self._label(self.heights.height_map())

    def height_map(self) -> HeightMap:
        """The map so far with its latest labels; until there are any, those of a map before."""
        height_map, classes = self.heights.height_map(), self.strategy.classes
        if self.strategy.every is None:
            self._label(height_map)
        latest, before = self.labels.latest.get("probabilities"), self._before
        if latest is not None:
            return labelled(height_map, latest, classes, FROM_MAP)
        if before is not None and before.probabilities is not None and before.sources is not None:
            return labelled(height_map, before.probabilities, classes, before.sources)
        return unlabelled(height_map, classes)

    def states(self) -> dict[str, dict[str, Any]]:
        """What to save for going on exactly."""
        return states_of(**{"heights": self.heights, MAP_LABELS: self.labels})

    def _label(self, height_map: HeightMap) -> None:
        if height_map.seen.mean() >= self.strategy.coverage:
            self.labels.latest = {"probabilities": self.strategy.map_source.label_map(height_map)}
