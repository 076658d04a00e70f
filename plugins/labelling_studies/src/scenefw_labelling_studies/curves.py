"""Label quality against frames and processing time (thesis figures 4.21, 4.23 and 4.24)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scenefw.core.settings import COUNT
from scenefw_labelling_studies.results import (
    HYBRID,
    CurvesResult,
    Example,
    Score,
    Scores,
    class_iou,
    scene_counts,
    score,
)

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw_labelling_studies.bench import Bench, Snapshot

Tracker = Callable[[Sequence[int], str], Iterable[int]]
Snapshots = Sequence[Mapping[str, "Snapshot"]]

_PICTURE = 256  # vertices per side of the maps of an example


class LabellingCurves:
    """Scores every strategy after growing numbers of frames of the same sequences.

    Args:
        bench: runs the strategies.
        frames: of each sequence.
        steps: how many numbers of frames are scored, evenly spaced up to `frames`.
        first: an earlier number of frames, scored too; None = none.
        shown: how many of them are kept as pictures of the first scene.
    """

    def __init__(
        self, bench: Bench, frames: int, steps: int = 10, first: int | None = None, shown: int = 5
    ) -> None:
        COUNT.require(frames=frames, steps=steps, shown=shown)
        self.bench = bench
        self.counts = frame_counts(frames, steps, first)
        self.shown = shown

    def run(self, track: Tracker = lambda scenes, _: scenes) -> CurvesResult:
        """Scores of all scenes; `track` wraps the loop in a progress bar."""
        rows: list[Score] = []
        seconds: dict[str, list[Mapping[str, float]]] = defaultdict(list)
        counts: dict[str, list[NDArray[np.int64]]] = defaultdict(list)
        example = None
        self.bench.warm_up()
        for scene in track(range(len(self.bench.scenes)), "scenes"):
            truth = self.bench.scenes.truth(scene)
            example = example or _ExampleMaker(truth, self._shown_counts())
            for snapshots in self.bench.run(scene, self.counts):
                for name, snapshot in snapshots.items():
                    rows.append(score(name, scene, snapshot, truth))
                    if scene == 0:
                        example.look(name, snapshot)
                    if snapshot.frames == self.counts[-1]:
                        seconds[name].append(snapshot.seconds)
                        counts[name].append(scene_counts(snapshot.height_map, truth))
        return CurvesResult(
            Scores(tuple(rows)),
            {name: mean_seconds(stage_times) for name, stage_times in seconds.items()},
            {name: class_iou(confusions) for name, confusions in counts.items()},
            self.bench.classes,
            example.build() if example else None,
        )

    def _shown_counts(self) -> tuple[int, ...]:
        places = np.linspace(0, len(self.counts) - 1, min(self.shown, len(self.counts)))
        return tuple(self.counts[round(place)] for place in places)


def frame_counts(frames: int, steps: int, first: int | None = None) -> tuple[int, ...]:
    """Evenly spaced numbers of frames up to `frames`, preceded by `first` if given."""
    even = {max(1, round(frames * (i + 1) / steps)) for i in range(steps)}
    early = {first} if first is not None and first < min(even) else set()
    return tuple(sorted(even | early))


def mean_seconds(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Mean of each stage."""
    return {stage: float(np.mean([row.get(stage, 0.0) for row in rows])) for stage in rows[0]}


class _ExampleMaker:
    """Collects thinned-out maps of one scene."""

    def __init__(self, truth: HeightMap, frames: tuple[int, ...]) -> None:
        self.step = max(1, truth.grid.vertices // _PICTURE)
        self.truth, self.frames = truth, frames
        self.colour: dict[int, NDArray[np.uint8]] = {}
        self.labels: dict[tuple[str, int], NDArray[np.int8]] = {}
        self.sources: dict[int, NDArray[np.uint8]] = {}

    def look(self, name: str, snapshot: Snapshot) -> None:
        """Keeps a map if its number of frames is one of those shown."""
        if snapshot.frames not in self.frames or snapshot.height_map.labels is None:
            return
        self.colour[snapshot.frames] = self._thin(snapshot.height_map.colour)
        labels = self._thin(snapshot.height_map.labels)
        self.labels[name, snapshot.frames] = labels.astype(np.int8)
        if name == HYBRID and snapshot.height_map.sources is not None:
            self.sources[snapshot.frames] = self._thin(snapshot.height_map.sources)

    def build(self) -> Example:
        """The example."""
        labels = self.truth.labels
        if labels is None:
            labels = np.full(self.truth.grid.shape, -1, np.int32)
        return Example(
            self.frames,
            self.colour,
            self.labels,
            self.sources,
            self._thin(labels).astype(np.int8),
            self._thin(self.truth.colour),
        )

    def _thin(self, image: NDArray) -> NDArray:  # type: ignore[type-arg]
        return image[:: self.step, :: self.step].copy()
