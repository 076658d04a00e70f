"""Map-based labelling: geometry and colour are fused first, the map is labelled as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenefw.core.labels import FROM_MAP, labelled, unlabelled
from scenefw.core.settings import COUNT, SHARE
from scenefw.labelling.running import HEIGHTS, MAP_LABELS, MapLabels, require_classes, state_of

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.labelling_protocols import HeightMapping, MapLabelSource, States
    from scenefw.core.types import Frame


@dataclass(frozen=True, eq=False)
class MapBased:
    """Labels the fused height map (thesis 4.7.4).

    Args:
        heights: fuses depth and colour of all frames.
        map_source: labels a height map.
        every: the map is labelled every N frames; None = whenever it is requested, so once
            at the end if it is requested once.
        coverage: least share of vertices seen; before, all are unknown. The thesis waits until
            the scene is covered, so that the network sees no half-empty map.
    """

    heights: HeightMapping
    map_source: MapLabelSource
    every: int | None = None
    coverage: float = 0.0

    def __post_init__(self) -> None:
        COUNT.require(every=self.every)
        SHARE.require(coverage=self.coverage)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return tuple(self.map_source.classes)

    def begin(
        self, previous: HeightMap | None = None, states: States | None = None
    ) -> RunningMapBased:
        """Starts a scene or resumes a saved one, exactly if its states are given.

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
        self.heights = strategy.heights.begin(previous, state_of(HEIGHTS, states))
        self.labels = MapLabels(strategy.every, states)
        self._before = previous

    def add(self, frame: Frame) -> None:
        """Fuses the frame; labels the map if it is time."""
        self.heights.add(frame)
        if self.labels.due():
            self._label(self.heights.height_map())

    def height_map(self) -> HeightMap:
        """The map so far with its latest labels; until there are any, those of the earlier map."""
        height_map, classes = self.heights.height_map(), self.strategy.classes
        if self.strategy.every is None:
            self._label(height_map)
        latest, before = self.labels.latest.get("probabilities"), self._before
        if latest is not None:
            return labelled(height_map, latest, classes, FROM_MAP)
        if before is not None and before.probabilities is not None and before.sources is not None:
            return labelled(height_map, before.probabilities, classes, before.sources)
        return unlabelled(height_map, classes)

    def states(self) -> States:
        """The state to resume from exactly."""
        return {HEIGHTS: self.heights.state(), MAP_LABELS: self.labels.state()}

    def _label(self, height_map: HeightMap) -> None:
        if height_map.seen.mean() >= self.strategy.coverage:
            self.labels.latest = {"probabilities": self.strategy.map_source.label_map(height_map)}
