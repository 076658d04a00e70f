"""Accuracy of the two labelling networks on single views and fused maps (thesis table 4.1).

Rules without learning label the same maps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError, InputError
from scenefw.metrics.semantic import class_ious, count_classes, mean_iou, weighted_iou
from scenefw.noise.frames import disturb
from scenefw_labelling_studies.measures import of_networks

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.labelling_protocols import (
        FrameSource,
        HeightMapping,
        LabelSource,
        MapLabelSource,
    )
    from scenefw.core.measures import Measure
    from scenefw.core.protocols import Noise

Counts = NDArray[np.int64]
Tracker = Callable[[Sequence[int], str], Iterable[int]]
VIEWS, MAPS = "views", "maps"


@dataclass(frozen=True)
class NetworksResult:
    """Counts of both networks over the whole test set.

    Args:
        counts: (C, C + 1) of true against predicted classes, by network (`views`, `maps`), then by
            reference.
        classes: names by class id.
        number: of views and of maps.
        frames: fused into each map.
    """

    counts: Mapping[str, Counts]
    classes: tuple[str, ...]
    number: Mapping[str, int]
    frames: int

    @property
    def figures(self) -> dict[str, float]:
        """Class-mean and frequency-weighted IoU and that of each class, by network."""
        figures: dict[str, float] = {}
        for name, counts in self.counts.items():
            figures[f"{name}/miou"] = mean_iou(counts)
            figures[f"{name}/weighted_iou"] = weighted_iou(counts)
            ious = zip(self.classes, class_ious(counts), strict=True)
            figures |= {f"{name}/{label}": float(iou) for label, iou in ious}
            figures[f"{name}/number"] = float(self.number[name])
        return {name: value for name, value in figures.items() if np.isfinite(value)}

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits and published values of the figures."""
        return of_networks(tuple(self.counts), self.classes)


class LabellingNetworks:
    """Counts right and wrong labels of test views, and of seen vertices of test maps.

    A map counts as a whole, each seen vertex once, instead of the thesis's random crops of it.

    Args:
        scenes: views and truth.
        source: labels views.
        map_source: labels maps.
        heights: fuses the maps.
        views: of each scene.
        frames: fused into each map.
        noise: disturbs views and the frames of maps.
        seed: of the noise.
        references: further labels of the same maps by name, of rules that learn nothing.

    Raises:
        ConfigError: a part knows other classes than the scenes.
    """

    def __init__(
        self,
        scenes: FrameSource,
        source: LabelSource,
        map_source: MapLabelSource,
        heights: HeightMapping,
        views: int,
        frames: int,
        noise: Mapping[str, Noise] | None = None,
        seed: int = 0,
        references: Mapping[str, MapLabelSource] | None = None,
    ) -> None:
        self.references = dict(references or {})
        reference_classes = {name: part.classes for name, part in self.references.items()}
        for name, classes in (
            (VIEWS, source.classes),
            (MAPS, map_source.classes),
            *reference_classes.items(),
        ):
            if tuple(classes) != tuple(scenes.classes):
                raise ConfigError(
                    f"{name} are labelled {', '.join(classes)}, the scenes contain "
                    f"{', '.join(scenes.classes)}; give a checkpoint or a rule for these classes"
                )
        self.scenes = scenes
        self.source = source
        self.map_source = map_source
        self.heights = heights
        self.views = views
        self.frames = frames
        self.noise = dict(noise or {})
        self.seed = seed

    def run(self, track: Tracker = lambda scenes, _: scenes) -> NetworksResult:
        """Counts over all scenes; `track` wraps the loop in a progress bar."""
        scenes = range(len(self.scenes))
        empty = np.zeros((len(self.scenes.classes), len(self.scenes.classes) + 1), np.int64)
        counts = dict.fromkeys((VIEWS, MAPS, *self.references), empty)
        for scene in track(scenes, "scenes"):
            for name, confusion in ({VIEWS: self._views(scene)} | self._maps(scene)).items():
                counts[name] = counts[name] + confusion
        number = dict.fromkeys(counts, len(scenes)) | {VIEWS: len(scenes) * self.views}
        return NetworksResult(counts, tuple(self.scenes.classes), number, self.frames)

    def _views(self, scene: int) -> Counts:
        total = np.zeros((len(self.scenes.classes), len(self.scenes.classes) + 1), np.int64)
        for index, frame in enumerate(self.scenes.frames(scene, self.views)):
            if frame.labels is None:
                raise InputError(f"{frame.name} has no true labels to score against")
            noisy_frame = disturb(frame, self.noise, self.seed, scene, index)
            predicted = self.source.label(noisy_frame).argmax(axis=0)
            total += count_classes(predicted, frame.labels, len(self.scenes.classes))
        return total

    def _maps(self, scene: int) -> dict[str, Counts]:
        truth, count = self.scenes.truth(scene).labels, len(self.scenes.classes)
        if truth is None:
            raise InputError(f"scene {scene} has no true labels to score against")
        fused = self._fused(scene)
        counts = {}
        for name, source in {MAPS: self.map_source, **self.references}.items():
            predicted = source.label_map(fused).argmax(axis=0)
            counts[name] = count_classes(predicted, truth, count, fused.seen)
        return counts

    def _fused(self, scene: int) -> HeightMap:
        running = self.heights.begin()
        for index, frame in enumerate(self.scenes.frames(scene, self.frames)):
            running.add(disturb(frame, self.noise, self.seed, scene, index))
        return running.height_map()
