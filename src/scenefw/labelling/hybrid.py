"""Hybrid labelling: labels of views from the first frame on, the map's where it is well built."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.core.labels import FROM_BOTH, FROM_MAP, FROM_VIEWS, known_mask, labelled
from scenefw.core.settings import COUNT
from scenefw.labelling.key_frames import EveryNth
from scenefw.labelling.pooling import Pool, disagreement
from scenefw.labelling.reconstruction import Reconstruction
from scenefw.labelling.running import MAP_LABELS, MapLabels
from scenefw.labelling.view_based import RunningViewBased, ViewBased

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.labelling_protocols import (
        HeightMapping,
        KeyFrames,
        LabelSource,
        MapLabelSource,
        SemanticMapping,
        States,
    )
    from scenefw.core.labels import Sources
    from scenefw.core.types import Float32, Frame


@dataclass(frozen=True, eq=False)
class Hybrid:
    """Fuses labels of views and refines them by labels of the map, as probabilities.

    The thesis only proposes it (4.9). Both distributions of a vertex are pooled (`pooling`), with
    weights that were estimated on scenes of their own (`experiment=hybrid_weights`).

    Args:
        heights: fuses depth and colour of all frames.
        labels: fuses the labels of key frames.
        source: labels a frame.
        map_source: labels a height map.
        pool: of both distributions.
        reconstruction: how well the map is built about each vertex.
        key_frames: which frames are labelled.
        every: the map is labelled every N frames; None = whenever it is requested.
        refresh: as that of `ViewBased`.

    Raises:
        ConfigError: the two sources have different classes, or only one.
    """

    heights: HeightMapping
    labels: SemanticMapping
    source: LabelSource
    map_source: MapLabelSource
    pool: Pool = field(default_factory=Pool)
    reconstruction: Reconstruction = field(default_factory=Reconstruction)
    key_frames: KeyFrames = field(default_factory=EveryNth)
    every: int | None = None
    refresh: int | None = None

    def __post_init__(self) -> None:
        classes, of_maps = tuple(self.source.classes), tuple(self.map_source.classes)
        if classes != of_maps:
            raise ConfigError(
                f"views are labelled with {', '.join(classes)}, maps with {', '.join(of_maps)}; "
                "give two checkpoints of the same classes"
            )
        if len(classes) < 2:
            raise ConfigError(
                f"the labels have only one class, {classes[0]}; give classes of the surface and "
                "of objects"
            )
        COUNT.require(every=self.every)
        object.__setattr__(self, "refresh", self.views.refresh)

    @property
    def views(self) -> ViewBased:
        """The strategy that labels views."""
        return ViewBased(self.heights, self.labels, self.source, self.key_frames, self.refresh)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return tuple(self.source.classes)

    def begin(
        self, previous: HeightMap | None = None, states: States | None = None
    ) -> RunningHybrid:
        """Starts a scene or resumes a saved one, exactly if its states are given.

        Raises:
            InputError: the map has other classes.
        """
        return RunningHybrid(self, self.views.begin(previous, states), states)


class RunningHybrid:
    """A map labelled from views, refined by its own labels when it is time."""

    def __init__(
        self, strategy: Hybrid, views: RunningViewBased, states: States | None = None
    ) -> None:
        self.strategy = strategy
        self.views = views
        self.labels = MapLabels(strategy.every, states)

    def add(self, frame: Frame) -> None:
        """Fuses the frame; labels the map if it is time."""
        self.views.add(frame)
        if self.labels.due():
            self._refine(self.views.heights.height_map())

    def height_map(self) -> HeightMap:
        """The map so far; its sources say whose class won: both's if they agree, or neither's."""
        height_map = self.views.height_map()
        if self.strategy.every is None:
            self._refine(height_map)
        views, latest = height_map.probabilities, self.labels.latest
        if views is None or not {"probabilities", "well"} <= set(latest):
            return height_map
        of_map, well = latest["probabilities"], latest["well"]
        pooled = self.strategy.pool(views, of_map, well)
        sources = _sources(views, of_map, pooled)
        return labelled(height_map, pooled, self.strategy.classes, sources)

    def states(self) -> States:
        """What to resume from exactly: the states of views and of the map's labels."""
        return {**self.views.states(), MAP_LABELS: self.labels.state()}

    def _refine(self, height_map: HeightMap) -> None:
        of_map = self.strategy.map_source.label_map(height_map)
        well = self.strategy.reconstruction.of(height_map)
        self.labels.latest = {"probabilities": of_map, "well": well}


def _sources(views: Float32, of_map: Float32, pooled: Float32) -> Sources:
    """Whose class each vertex has."""
    viewed, mapped = known_mask(views), known_mask(of_map)
    views_win, map_wins = disagreement(views, of_map, pooled)
    sources = np.full(viewed.shape, FROM_BOTH, np.uint8)
    sources[viewed & views_win & ~(mapped & map_wins)] = FROM_VIEWS
    sources[mapped & map_wins & ~(viewed & views_win)] = FROM_MAP
    return sources
