"""Quality of labels under pose and depth noise (thesis figures 4.25 and 4.26)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import in_order
from scenefw.evaluation.statistics import Interval, mean_interval, paired_interval
from scenefw_labelling_studies.measures import of_noise
from scenefw_labelling_studies.results import Score, Scores, read_scores, score

if TYPE_CHECKING:
    from scenefw.core.measures import Measure
    from scenefw.core.protocols import Noise
    from scenefw_labelling_studies.bench import Bench

Cell = tuple[float, float, int]  # pose, depth, scene
Tracker = Callable[[Sequence[Cell], str], Iterable[Cell]]
SCORES_FILE = "noise.csv"


@dataclass(frozen=True)
class NoiseResult:
    """Scores of all strategies for all amounts of noise."""

    scores: Scores

    @property
    def pose(self) -> tuple[float, ...]:
        """Amounts of pose noise (m), ascending."""
        return tuple(sorted({row.pose for row in self.scores.rows}))

    @property
    def depth(self) -> tuple[float, ...]:
        """Amounts of depth noise (m), ascending."""
        return tuple(sorted({row.depth for row in self.scores.rows}))

    @property
    def strategies(self) -> tuple[str, ...]:
        """Names."""
        return self.scores.strategies

    def cell(self, strategy: str, pose: float, depth: float, measure: str = "miou") -> Interval:
        """Mean over scenes with bounds, for one pair of amounts."""
        return mean_interval(list(self._values(strategy, pose, depth, measure).values()))

    def difference(self, strategy: str, baseline: str, pose: float, depth: float) -> Interval:
        """Mean IoU of a strategy minus that of another on the same scenes, with paired bounds."""
        ours, theirs = (self._values(name, pose, depth) for name in (strategy, baseline))
        shared = [scene for scene in ours if scene in theirs]
        return paired_interval([ours[s] for s in shared], [theirs[s] for s in shared])

    def _values(
        self, strategy: str, pose: float, depth: float, measure: str = "miou"
    ) -> dict[int, float]:
        """By scene."""
        return {
            row.scene: float(getattr(row, measure))
            for row in self.scores.rows
            if (row.strategy, row.pose, row.depth) == (strategy, pose, depth)
        }

    def grid(self, strategy: str, measure: str = "miou") -> NDArray[np.float64]:
        """(pose, depth) means; NaN where there are no scores."""
        return np.array(
            [[self.cell(strategy, p, d, measure).mean for d in self.depth] for p in self.pose]
        )

    @property
    def figures(self) -> dict[str, float]:
        """Means by strategy and amounts in millimetres."""
        cells = {
            f"{name}/{_amount(p, d)}": self.cell(name, p, d).mean
            for name in self.strategies
            for p in self.pose
            for d in self.depth
        }
        means = {name: value for name, value in cells.items() if np.isfinite(value)}
        return {"scenes": float(len(self.scores.scenes))} | means

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits and published values of the figures."""
        return of_noise(self.strategies, [_amount(p, d) for p in self.pose for d in self.depth])


class LabellingNoise:
    """Scores every strategy after all frames for every pair of amounts of noise.

    Args:
        bench: runs the strategies; its own noise is not used.
        frames: of each sequence.
        pose: amount or amounts of pose noise (m).
        depth: amount or amounts of depth noise (m).
        pose_noise: from `sigma` to noise of poses.
        depth_noise: from `sigma` to noise of depth.
        scenes: how many; None = all. The thesis has 3.
        chosen: names of the noises on the command line.

    Raises:
        ConfigError: an amount is not a length, or a chosen noise is not varied here.
    """

    def __init__(
        self,
        bench: Bench,
        frames: int,
        pose: float | Sequence[float],
        depth: float | Sequence[float],
        pose_noise: Callable[..., Noise],
        depth_noise: Callable[..., Noise],
        scenes: int | None = 3,
        chosen: Sequence[str] = (),
    ) -> None:
        unsupported = sorted(set(chosen) - {"pose", "gaussian"})
        if unsupported:
            raise ConfigError(
                f"a noise map varies only pose and Gaussian noise, not {', '.join(unsupported)}; "
                "give noise=[pose,gaussian] (experiment=view_vs_map compares under any noise)"
            )
        self.bench = bench
        self.frames = frames
        self.pose, self.depth = _amounts("pose", pose), _amounts("gaussian", depth)
        self.pose_noise, self.depth_noise = pose_noise, depth_noise
        self.scenes = scenes

    def run(self, track: Tracker = lambda cells, _: cells) -> NoiseResult:
        """Scores of all cells; `track` wraps the loop in a progress bar."""
        number = min(self.scenes or len(self.bench.scenes), len(self.bench.scenes))
        cells = [(p, d, s) for s in range(number) for p in self.pose for d in self.depth]
        rows = []
        for pose, depth, scene in track(cells, "amounts of noise"):
            noise = {"gaussian": self.depth_noise(sigma=depth), "pose": self.pose_noise(sigma=pose)}
            truth = self.bench.scenes.truth(scene)
            for snapshots in self.bench.run(scene, [self.frames], noise):
                rows += [
                    score(name, scene, snapshot, truth, pose=pose, depth=depth)
                    for name, snapshot in snapshots.items()
                ]
        return NoiseResult(Scores(tuple(rows)))


class GatheredNoise:
    """The scores of a sweep's runs as one result.

    Args:
        input: folder of the sweep, which holds the folders of its runs.

    Raises:
        ConfigError: no input is given.
    """

    def __init__(self, input: str | Path | None) -> None:  # noqa: A002 - as on the command line
        if input is None:
            raise ConfigError("gathering needs the runs of a sweep; give input=FOLDER of the sweep")
        self.input = Path(input)

    def run(self, track: object = None) -> NoiseResult:
        """All scores found.

        Raises:
            InputError: there are none, or runs that can't be one result: of different numbers of
                frames, or of the same amounts and other scores.
        """
        paths = in_order(self.input.rglob(SCORES_FILE))
        if not paths:
            raise InputError(
                f"no {SCORES_FILE} below {self.input}; give the folder of a sweep of "
                "experiment=noise_map"
            )
        rows: dict[tuple[str, int, float, float], tuple[Score, Path]] = {}
        for path in paths:
            for row in read_scores(path).rows:
                key = (row.strategy, row.scene, row.pose, row.depth)
                first, origin = rows.setdefault(key, (row, path))
                if (first.frames, first.miou) != (row.frames, row.miou):
                    raise InputError(
                        f"{origin} and {path} both score {row.strategy} on scene {row.scene} under "
                        f"pose {row.pose:g} m and depth {row.depth:g} m, after {first.frames} and "
                        f"{row.frames} frames; give a folder of runs of one sweep"
                    )
        scores = Scores(tuple(row for row, _ in rows.values()))
        if len(scores.counts) > 1:
            counts = " and ".join(map(str, scores.counts))
            raise InputError(
                f"runs below {self.input} are of {counts} frames; give a folder of runs of one "
                "size.frames"
            )
        return NoiseResult(scores)


def _amount(pose: float, depth: float) -> str:
    return f"pose {1000 * pose:g} mm, depth {1000 * depth:g} mm"


def _amounts(name: str, values: float | Sequence[float]) -> tuple[float, ...]:
    listed = [values] if isinstance(values, int | float) else list(values)
    if not listed or not all(isinstance(v, int | float) and v >= 0 for v in listed):
        raise ConfigError(
            f"noise.{name}.sigma = {values}; expected an amount in metres or a list of them"
        )
    return tuple(float(v) for v in listed)
