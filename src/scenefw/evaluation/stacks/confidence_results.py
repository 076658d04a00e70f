"""How sure methods are of objects, and how right that is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import stats

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.core.types import Float64
from scenefw.evaluation.statistics import Interval, bootstrap_interval
from scenefw.postprocessing.confidence import Calibration

SAID, SHIPPED, FITTED, CONSTANT = "said", "shipped", "fitted", "constant"
"""Agreement as it is; calibrated as `run=predict` does; by the other half; the mean of that."""

SCORES = {
    "bias": Measure("bias", "expected IoU less the true one", "", 3),
    "error": Measure("error", "root mean squared error of the expected IoU", "", 3, "lower"),
    "skill": Measure("skill", "squared error, from the constant to none", "%", 1, "higher", 100.0),
}
_FIGURES = {
    "objects": Measure("objects", digits=0),
    "scenes": Measure("scenes", digits=0),
    "iou": Measure("IoU", "mean IoU of predicted objects with true ones", "", 3),
    "agreement": Measure("agreement", "mean agreement of samples", "", 3),
    "rank": Measure("rank correlation", "rank correlation of agreement and IoU", "", 2, "higher"),
}
_TESTED = 2  # values that a correlation needs at least


@dataclass(frozen=True)
class ObjectConfidence:
    """One predicted object.

    Args:
        scene: number in its data set.
        said: how alike samples are.
        iou: with the true object that it is most like.
    """

    scene: int
    said: float
    iou: float


@dataclass(frozen=True)
class ConfidenceResult:
    """All predicted objects of a split.

    Args:
        objects: scene by scene.
        samples: of each view.
        calibration: of `run=predict`; None: it has none.
    """

    objects: tuple[ObjectConfidence, ...]
    samples: int
    calibration: Calibration | None = None

    @cached_property
    def agreement(self) -> Float64:
        """(N,) agreement."""
        return np.array([item.said for item in self.objects], dtype=np.float64)

    @cached_property
    def iou(self) -> Float64:
        """(N,) with the truth."""
        return np.array([item.iou for item in self.objects], dtype=np.float64)

    @cached_property
    def scenes(self) -> np.ndarray:
        """(N,) of which scene."""
        return np.array([item.scene for item in self.objects], dtype=np.int64)

    @cached_property
    def expected(self) -> dict[str, Float64]:
        """(N,) IoU that each way expects. What is fitted is fitted to the other half of scenes."""
        expected_ious = {SAID: self.agreement}
        if self.calibration is not None:
            expected_ious[SHIPPED] = self.calibration(self.agreement)
        expected_ious[FITTED] = self._halves(lambda s, t: Calibration.fitted(s, t))
        expected_ious[CONSTANT] = self._halves(lambda _, t: Calibration([0.5], [float(t.mean())]))
        return expected_ious

    def _halves(self, fit: Callable[[Float64, Float64], Calibration]) -> Float64:
        place = np.unique(self.scenes, return_inverse=True)[1]
        expected_ious = self.agreement.copy()
        for half in (0, 1):
            test_mask, fit_mask = place % 2 == half, place % 2 != half
            if fit_mask.any():
                expected_ious[test_mask] = fit(self.agreement[fit_mask], self.iou[fit_mask])(
                    self.agreement[test_mask]
                )
        return expected_ious

    @cached_property
    def fitted(self) -> Calibration | None:
        """To all objects: what `calibration` of a prediction takes; None without objects."""
        return Calibration.fitted(self.agreement, self.iou) if self.objects else None

    def score(self, way: str, name: str) -> Interval:
        """With bootstrap bounds over scenes."""
        off = self.expected[way] - self.iou
        constant = self.expected[CONSTANT] - self.iou
        columns = np.stack([off, off**2, constant**2], axis=1)
        statistic: dict[str, Callable[[Float64], Float64]] = {
            "bias": lambda m: m[..., 0],
            "error": lambda m: np.sqrt(m[..., 1]),
            "skill": lambda m: 1 - m[..., 1] / np.maximum(m[..., 2], 1e-12),
        }
        return bootstrap_interval(columns, self.scenes.tolist(), statistic[name])

    @property
    def figures(self) -> dict[str, float]:
        """`<way>/<score>` with bounds, and facts of all objects."""
        figures = {
            "objects": float(len(self.objects)),
            "scenes": float(len(np.unique(self.scenes))),
        }
        if not self.objects:
            return figures
        figures |= {"iou": float(self.iou.mean()), "agreement": float(self.agreement.mean())}
        if np.ptp(self.agreement) > 0 and np.ptp(self.iou) > 0 and len(self.objects) > _TESTED:
            figures["rank"] = float(stats.spearmanr(self.agreement, self.iou).statistic)
        for way in self.expected:
            for name in SCORES:
                interval = self.score(way, name)
                ends = {"": interval.mean, LOW: interval.low, HIGH: interval.high}
                figures |= {f"{way}/{name}{end}": v for end, v in ends.items() if np.isfinite(v)}
        return figures

    @property
    def measures(self) -> dict[str, Measure]:
        """Units and digits."""
        ways = {
            f"{way}/{name}": measure for way in self.expected for name, measure in SCORES.items()
        }
        return {**_FIGURES, **ways}
