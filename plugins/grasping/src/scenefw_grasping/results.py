"""What became of grasps that were chosen in predicted scenes, and its summaries."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.core.types import Camera, Float64
from scenefw.evaluation.statistics import Interval, bootstrap_interval
from scenefw_grasping.choices import (
    CHOSEN,
    MEAN,
    OF_A_SCENE,
    OF_AN_OBJECT,
    ORACLE,
    TOPMOST,
    Tried,
    score,
)
from scenefw_grasping.grasps import Film

ANY, GIVEN = "any", "given"
"""The object is chosen too, or it is given (thesis 5.5)."""

SCORES = {
    "disturbance": Measure(
        "others move", "displacement of the other objects, mean", "mm", 1, "lower", 1000.0
    ),
    "failed": Measure("failed lifts", "lifts that failed", "%", 0, "lower", 100.0),
    "clean": Measure(
        "clean lifts", "lifts that succeed and disturb nothing", "%", 0, "higher", 100.0
    ),
}
_NUMBERS = {
    "scenes": Measure("scenes", digits=0),
    "candidates": Measure("candidates", "grasps tried per scene", digits=1),
    "without": Measure("scenes without a grasp", digits=0),
    "predicted": Measure(
        "predicted", "disturbance that the simulation predicts of the chosen grasp", "mm", 1,
        "lower", 1000.0,
    ),
    "rank_correlation": Measure(
        "rank correlation", "predicted and true disturbance of a scene's grasps, rank correlation",
        digits=2, better="higher",
    ),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class GraspExample:
    """The chosen grasp of a scene, as it was rehearsed and as it went.

    Args:
        name: of the scene.
        words: what became of it, one line.
        camera: that saw the scene.
        predicted: in the predicted scene.
        true: in the true one; labels are those of the prediction where objects correspond.
    """

    name: str
    words: str
    camera: Camera
    predicted: Film
    true: Film


@dataclass(frozen=True)
class SceneGrasps:
    """Grasps of one scene.

    Args:
        scene: number of the scene in its data set.
        tries: in the order of the ranking.
        left_out: why predicted objects have none, in words.
    """

    scene: int
    tries: tuple[Tried, ...]
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class GraspingResult:
    """Grasps of every scene.

    Args:
        scenes: with their grasps.
        still: objects that move by less are undisturbed (m).
        examples: films of some.
    """

    scenes: tuple[SceneGrasps, ...]
    still: float
    examples: tuple[GraspExample, ...] = ()

    @cached_property
    def groups(self) -> Mapping[str, list[tuple[int, tuple[Tried, ...]]]]:
        """Sets of grasps to choose from, each with its scene, by protocol."""
        scene_groups = [(scene.scene, scene.tries) for scene in self.scenes if scene.tries]
        object_groups = []
        for scene in self.scenes:
            for label in dict.fromkeys(grasp.label for grasp in scene.tries):
                object_tries = tuple(grasp for grasp in scene.tries if grasp.label == label)
                if len(object_tries) > 1:
                    object_groups.append((scene.scene, object_tries))
        return {ANY: scene_groups, GIVEN: object_groups}

    def values(self, protocol: str, choice: str) -> Float64:
        """Scores (G, 3) of each set of grasps, in the order of SCORES."""
        chooser = (OF_A_SCENE if protocol == ANY else OF_AN_OBJECT)[choice]
        rows = [score(chooser, tries, self.still) for _, tries in self.groups[protocol]]
        return np.reshape(rows, (-1, len(SCORES)))

    def interval(self, protocol: str, choice: str, name: str) -> Interval:
        """Mean over scenes with bootstrap bounds."""
        column = list(SCORES).index(name)
        scenes = [scene for scene, _ in self.groups[protocol]]
        values = self.values(protocol, choice)[:, column, None]
        return bootstrap_interval(values, scenes, lambda means: means[..., 0])

    def gain(self, protocol: str, reference: str, name: str) -> Interval:
        """Score of the chosen grasp minus that of another choice, on the same scenes."""
        column = list(SCORES).index(name)
        scenes = [scene for scene, _ in self.groups[protocol]]
        values = [self.values(protocol, choice)[:, column] for choice in (CHOSEN, reference)]
        return bootstrap_interval(np.stack(values, axis=1), scenes, lambda m: m[..., 0] - m[..., 1])

    def failures(self, protocol: str, choice: str) -> Counter[str]:
        """Why lifts of one choice failed, and how often."""
        chooser = (OF_A_SCENE if protocol == ANY else OF_AN_OBJECT)[choice]
        groups = self.groups[protocol]
        grasps = [
            grasp for _, tries in groups for grasp in ([chooser(tries)] if chooser else tries)
        ]
        return Counter(grasp.failure for grasp in grasps if grasp.failure)

    @property
    def reasons(self) -> Counter[str]:
        """How often objects had no grasp, by reason."""
        return Counter(reason.split(":")[0] for scene in self.scenes for reason in scene.left_out)

    @property
    def figures(self) -> dict[str, float]:
        """`<any or given>/<choice>/<score>` with bounds, and numbers of what was tried."""
        figures: dict[str, float] = {}
        for protocol, choices in ((ANY, OF_A_SCENE), (GIVEN, OF_AN_OBJECT)):
            for choice in choices:
                for name in SCORES:
                    interval = self.interval(protocol, choice, name)
                    ends = {"": interval.mean, LOW: interval.low, HIGH: interval.high}
                    figures |= {
                        f"{protocol}/{choice}/{name}{end}": value
                        for end, value in ends.items()
                        if np.isfinite(value)
                    }
        figures |= {
            "scenes": float(len(self.scenes)),
            "without": float(sum(not scene.tries for scene in self.scenes)),
            "candidates": float(np.mean([len(scene.tries) for scene in self.scenes])),
        }
        firsts = [min(t, key=lambda grasp: grasp.rank).predicted for _, t in self.groups[ANY]]
        extra = {
            "predicted": float(np.mean(firsts)) if firsts else float("nan"),
            "rank_correlation": self.rank_correlation,
        }
        return figures | {name: value for name, value in extra.items() if np.isfinite(value)}

    @property
    def rank_correlation(self) -> float:
        """Spearman's, of predicted and true disturbances in a scene, mean over scenes."""
        from scipy.stats import spearmanr

        correlations = []
        for _, tries in self.groups[ANY]:
            a, b = [grasp.predicted for grasp in tries], [grasp.disturbance for grasp in tries]
            if len(tries) > 2 and np.ptp(a) > 0 and np.ptp(b) > 0:
                correlations.append(float(spearmanr(a, b).statistic))
        return float(np.mean(correlations)) if correlations else float("nan")

    @property
    def measures(self) -> dict[str, Measure]:
        """Units, digits, and which figure stands for no simulation."""
        measures = dict(_NUMBERS)
        for protocol, choices in ((ANY, OF_A_SCENE), (GIVEN, OF_AN_OBJECT)):
            reference = TOPMOST if protocol == ANY else "best_seal"
            kind = "any object" if protocol == ANY else "a given object"
            for choice in choices:
                for name, measure in SCORES.items():
                    simulates = choice not in (MEAN, ORACLE, reference)
                    measures[f"{protocol}/{choice}/{name}"] = replace(
                        measure,
                        name=f"{measure.name}, {choice.replace('_', ' ')}, {kind}",
                        trivial=f"{protocol}/{reference}/{name}" if simulates else None,
                    )
        return measures
