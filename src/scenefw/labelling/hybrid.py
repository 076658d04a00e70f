"""Hybrid labelling: labels of views from the first frame on, the map's where it is well built."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.core.labels import FROM_BOTH, FROM_MAP, FROM_VIEWS
from scenefw.labelling.pooling import Pool, disagreement
from scenefw.labelling.reconstruction import Reconstruction
from scenefw.labelling.running import MAP_LABELS, MapLabels, known, labelled, states_of
from scenefw.labelling.view_based import RunningViewBased, ViewBased

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.protocols import (
        HeightMapping,
        LabelSource,
        MapLabelSource,
        SemanticMapping,
    )
    from scenefw.core.types import Float32, Frame
    from scenefw.labelling.key_frames import KeyFrames
    from scenefw.labelling.running import Share, Sources, States


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
        key_frames: which frames are labelled; None = all.
        every: the map is labelled at every so many frames; None = whenever it is asked for.
        refresh: as that of `ViewBased`.

    Raises:
        ConfigError: the two sources have different classes, or only one.
    """

    def __init__(
        self,
        heights: HeightMapping,
        labels: SemanticMapping,
        source: LabelSource,
        map_source: MapLabelSource,
        pool: Pool | None = None,
        reconstruction: Reconstruction | None = None,
        key_frames: KeyFrames | None = None,
        every: int | None = None,
        refresh: int | None = None,
    ) -> None:
        if tuple(source.classes) != tuple(map_source.classes):
            raise ConfigError(
                f"views are labelled with {', '.join(source.classes)}, maps with "
                f"{', '.join(map_source.classes)}; give two checkpoints of the same classes"
            )
        if len(source.classes) < 2:
            raise ConfigError(
                f"the labels have one class alone, {source.classes[0]}; give classes of the "
                "surface and of objects"
            )
        if every is not None and every < 1:
            raise ConfigError(f"every = {every}; expected a number of frames, or null")
        self.views = ViewBased(heights, labels, source, key_frames, refresh)
        self.map_source = map_source
        self.pool = pool or Pool()
        self.reconstruction = reconstruction or Reconstruction()
        self.every = every

    @property
    def classes(self) -> tuple[str, ...]:
        """Names by class id."""
        return self.views.classes

    def sharing(self, share: Share) -> Hybrid:
        """The same strategy with each part replaced, for runs side by side on the same frames."""
        return Hybrid(
            share("heights", self.views.heights),
            share("labels", self.views.labels),
            share("source", self.views.source),
            share("map_source", self.map_source),
            self.pool,
            self.reconstruction,
            self.views.key_frames,
            self.every,
            self.views.refresh,
        )

    def begin(
        self, previous: HeightMap | None = None, states: States | None = None
    ) -> RunningHybrid:
        """Starts a scene, or goes on with a saved one (exactly, if its states are given).

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
        """Fuses the frame; labels the map if its frame has come."""
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

    def states(self) -> dict[str, dict[str, Any]]:
        """What to save for going on exactly: that of views and map."""
        return self.views.states() | states_of(**{MAP_LABELS: self.labels})

    def _refine(self, height_map: HeightMap) -> None:
        of_map = self.strategy.map_source.label_map(height_map)
        well = self.strategy.reconstruction.of(height_map)
        self.labels.latest = {"probabilities": of_map, "well": well}


def _sources(views: Float32, of_map: Float32, pooled: Float32) -> Sources:
    """Whose class each vertex has."""
    viewed, mapped = known(views), known(of_map)
    views_win, map_wins = disagreement(views, of_map, pooled)
    sources = np.full(viewed.shape, FROM_BOTH, np.uint8)
    sources[viewed & views_win & ~(mapped & map_wins)] = FROM_VIEWS
    sources[mapped & map_wins & ~(viewed & views_win)] = FROM_MAP
    return sources
