"""Scores of strategies by scene and number of frames, and their summaries."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.files import write_text
from scenefw.evaluation.statistics import Interval, mean_interval, paired_interval
from scenefw.metrics.semantic import class_ious, count_classes, mean_iou
from scenefw_labelling_studies.measures import of_curves

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.measures import Measure
    from scenefw_labelling_studies.bench import Snapshot

VIEW_BASED, MAP_BASED, HYBRID = "view_based", "map_based", "hybrid"


@dataclass(frozen=True)
class Score:
    """One strategy on one scene after some frames.

    Args:
        strategy: its name.
        scene: number of the scene.
        frames: number of frames that made the map.
        miou: mean over the scene's classes of the IoU over all vertices; unseen and unlabelled
            ones count as missed.
        miou_seen: the same over seen vertices alone.
        coverage: share of vertices seen.
        seconds: of processing, without loading.
        height_rms: root mean square error of seen heights (m).
        height_median: median absolute error of seen heights (m).
        pose: standard deviation of pose noise (m).
        depth: standard deviation of depth noise (m).
    """

    strategy: str
    scene: int
    frames: int
    miou: float
    miou_seen: float
    coverage: float
    seconds: float
    height_rms: float
    height_median: float
    pose: float = 0.0
    depth: float = 0.0


MEASURES = ("miou", "miou_seen", "coverage", "seconds", "height_rms", "height_median")
_READ = {"strategy": str, "scene": int, "frames": int}


@dataclass(frozen=True)
class Example:
    """Thinned-out maps of one scene, for pictures.

    Args:
        frames: numbers of frames, one per column.
        colour: fused colour by number of frames.
        labels: (strategy, frames) -> class ids, -1 = unknown.
        sources: where the hybrid's labels come from, by number of frames.
        truth: class ids.
        true_colour: of the scene.
    """

    frames: tuple[int, ...]
    colour: Mapping[int, NDArray[np.uint8]]
    labels: Mapping[tuple[str, int], NDArray[np.int8]]
    sources: Mapping[int, NDArray[np.uint8]]
    truth: NDArray[np.int8]
    true_colour: NDArray[np.uint8]


@dataclass(frozen=True)
class Scores:
    """Scores of all strategies; the same scenes, frames and noise for each.

    Args:
        rows: in any order.
    """

    rows: tuple[Score, ...]

    @property
    def strategies(self) -> tuple[str, ...]:
        """Names in order of appearance."""
        return tuple(dict.fromkeys(row.strategy for row in self.rows))

    @property
    def counts(self) -> tuple[int, ...]:
        """Numbers of frames, ascending."""
        return tuple(sorted({row.frames for row in self.rows}))

    @property
    def scenes(self) -> tuple[int, ...]:
        """Indices of scenes, ascending."""
        return tuple(sorted({row.scene for row in self.rows}))

    def values(self, strategy: str, measure: str) -> NDArray[np.float64]:
        """(scenes, counts) of a measure; NaN where there is no row."""
        values = np.full((len(self.scenes), len(self.counts)), np.nan)
        for row in self.rows:
            if row.strategy == strategy:
                place = self.scenes.index(row.scene), self.counts.index(row.frames)
                values[place] = getattr(row, measure)
        return values

    def curve(self, strategy: str, measure: str) -> tuple[Interval, ...]:
        """Mean over scenes with 95 % bounds, per number of frames."""
        return tuple(mean_interval(column) for column in self.values(strategy, measure).T)

    def advantage(
        self, strategy: str, baseline: str, measure: str = "miou"
    ) -> tuple[Interval, ...]:
        """Mean paired difference to another strategy, per number of frames."""
        ours, theirs = self.values(strategy, measure), self.values(baseline, measure)
        return tuple(paired_interval(a, b) for a, b in zip(ours.T, theirs.T, strict=True))

    def final(self, strategy: str, measure: str = "miou") -> Interval:
        """The last point of a curve."""
        return self.curve(strategy, measure)[-1]


@dataclass(frozen=True)
class CurvesResult:
    """Figures 4.21, 4.23 and 4.24.

    Args:
        scores: of all strategies.
        seconds: per strategy and stage, mean over scenes after all frames.
        class_iou: per strategy the IoU (C,) of each class after all frames, over all scenes.
        classes: names by class id.
        example: maps of the first scene.
    """

    scores: Scores
    seconds: Mapping[str, Mapping[str, float]]
    class_iou: Mapping[str, NDArray[np.float64]]
    classes: tuple[str, ...]
    example: Example | None = field(default=None, repr=False)

    @property
    def figures(self) -> dict[str, float]:
        """Means after all frames, `<strategy>/<measure>`, with bounds of the mean IoU."""
        figures = {
            "scenes": float(len(self.scores.scenes)),
            "frames": float(self.scores.counts[-1]),
        }
        for strategy in self.scores.strategies:
            for measure in MEASURES:
                figures[f"{strategy}/{measure}"] = self.scores.final(strategy, measure).mean
            bounds = self.scores.final(strategy)
            figures |= {f"{strategy}/miou_low": bounds.low, f"{strategy}/miou_high": bounds.high}
        return {name: value for name, value in figures.items() if np.isfinite(value)}

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits and published values of the figures."""
        return of_curves(self.scores.strategies)


def score(
    strategy: str, scene: int, snapshot: Snapshot, truth: HeightMap, **amounts: float
) -> Score:
    """Scores of a snapshot against the orthographic truth.

    Raises:
        InputError: map and truth lie on different grids.
    """
    height_map = snapshot.height_map
    if height_map.grid != truth.grid:
        raise InputError(
            f"the map is on the grid {height_map.grid}, the truth on {truth.grid}; fuse on the "
            "grid of the scenes (size.map_vertices)"
        )
    common = height_map.seen & truth.seen
    errors = np.abs(height_map.heights[common].astype(np.float64) - truth.heights[common])
    return Score(
        strategy,
        scene,
        snapshot.frames,
        mean_iou(scene_counts(height_map, truth)),
        mean_iou(scene_counts(height_map, truth, height_map.seen)),
        float(height_map.seen.mean()),
        snapshot.processing,
        float(np.sqrt(np.mean(errors**2))) if len(errors) else float("nan"),
        float(np.median(errors)) if len(errors) else float("nan"),
        **amounts,
    )


def scene_counts(
    height_map: HeightMap, truth: HeightMap, where: NDArray[np.bool_] | None = None
) -> NDArray[np.int64]:
    """Counts (C, C + 1) of true against predicted classes, see `metrics.semantic`."""
    if height_map.labels is None or truth.labels is None:
        raise InputError("a map without labels can't be scored")
    return count_classes(height_map.labels, truth.labels, len(truth.classes), where)


def class_iou(counts: Sequence[NDArray[np.int64]]) -> NDArray[np.float64]:
    """IoU (C,) of each class over the vertices of several scenes together."""
    return class_ious(np.sum(counts, axis=0))


def write_scores(path: Path, scores: Scores) -> Path:
    """Writes a table (CSV) with a row per score."""
    names = [f.name for f in fields(Score)]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([[getattr(row, name) for name in names] for row in scores.rows])
    write_text(path, buffer.getvalue())
    return path


def read_scores(path: Path) -> Scores:
    """Reads what `write_scores` wrote.

    Raises:
        InputError: the file is missing or no such table.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [
                Score(**{f.name: _READ.get(f.name, float)(row[f.name]) for f in fields(Score)})
                for row in csv.DictReader(file)
            ]
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{path} is not a table of labelling scores ({error}); give the folder of a run of "
            "experiment=noise_map"
        ) from error
    return Scores(tuple(rows))
