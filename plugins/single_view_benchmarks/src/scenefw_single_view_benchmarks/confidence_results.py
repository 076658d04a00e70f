"""How sure methods are of objects, and how right that is."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.evaluation.statistics import Interval, bootstrap_interval
from scenefw.perception.estimate.shape_cues import CUES
from scenefw.postprocessing.confidence import ExpectedOverlap

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from scenefw.core.types import Float64

AGREEMENT, CONFIDENCE, FITTED, CONSTANT = "agreement", "confidence", "fitted", "constant"
"""Of hypotheses; of `run=predict`; fitted to other images; mean IoU of these."""

SCORES = {
    "bias": Measure("bias", "expected IoU less the true one", "", 3),
    "error": Measure("error", "root mean squared error of the expected IoU", "", 3, "lower"),
    "skill": Measure("skill", "squared error, from the constant to none", "%", 1, "higher", 100.0),
    "gap": Measure("calibration error", "of groups of equal size", "", 3, "lower"),
    "rank": Measure("rank correlation", "of expected and true IoU", "", 2, "higher"),
}
_FACTS = {
    "objects": Measure("objects", digits=0),
    "images": Measure("images", digits=0),
    "iou": Measure("IoU", "mean IoU of predicted objects with true ones", "", 3),
}
_MIN_RANKED = 3  # values that a correlation needs
_GROUPS, _MIN_GROUP = 8, 10  # of equal size, and objects of one
_RESAMPLES = 1000


@dataclass(frozen=True)
class ObjectConfidence:
    """One predicted object.

    Args:
        family: of its image.
        scene: number of the image in its family.
        marked: somebody had said which pixels show the objects.
        iou: with the true object that it is most like.
        confidence: of `run=predict`.
        cues: numbers that it is made of, by name.
    """

    family: str
    scene: int
    marked: bool
    iou: float
    confidence: float
    cues: Mapping[str, float]


@dataclass(frozen=True)
class ConfidenceResult:
    """All predicted objects of some families of images.

    Args:
        objects: image by image.
        samples: of each view.
        validation: families that nothing is fitted to.
    """

    objects: tuple[ObjectConfidence, ...]
    samples: int
    validation: frozenset[str] = frozenset()

    @property
    def families(self) -> tuple[str, ...]:
        """Names in the order of the objects."""
        return tuple(dict.fromkeys(item.family for item in self.objects))

    @cached_property
    def iou(self) -> Float64:
        """(N,) with the truth."""
        return np.array([item.iou for item in self.objects], dtype=np.float64)

    @cached_property
    def cues(self) -> Float64:
        """(N, K) in the order of `CUES`."""
        rows = [[item.cues[name] for name in CUES] for item in self.objects]
        return np.array(rows, dtype=np.float64).reshape(-1, len(CUES))

    @cached_property
    def is_validation(self) -> np.ndarray:
        """(N,) whether nothing is fitted to an object."""
        return np.array([item.family in self.validation for item in self.objects], dtype=bool)

    @cached_property
    def images(self) -> np.ndarray:
        """(N,) number of the image of each object; those of one scene count as one."""
        keys = [f"{item.family} {item.scene}" for item in self.objects]
        return np.unique(keys, return_inverse=True)[1]

    @cached_property
    def expected(self) -> dict[str, Float64]:
        """(N,) IoU that each way expects. What is fitted is fitted to other images."""
        expected_ious = {
            AGREEMENT: np.array([item.cues["agreement"] for item in self.objects]),
            CONFIDENCE: np.array([item.confidence for item in self.objects]),
        }
        if not self.is_validation.all():
            expected_ious[FITTED] = self._of_others(
                lambda fit, test: self._fit(fit)(self.cues[test])
            )
            expected_ious[CONSTANT] = self._of_others(
                lambda fit, test: np.full(test.sum(), self.iou[fit].mean())
            )
        return expected_ious

    def _of_others(self, predict: Callable[[np.ndarray, np.ndarray], Float64]) -> Float64:
        """Each half of the scenes by the other; those of validation by all that isn't."""
        is_odd = np.array([item.scene % 2 == 1 for item in self.objects])
        expected_ious = np.full(len(self.objects), np.nan)
        validation = self.is_validation
        parts = [(validation, ~validation)]
        parts += [(~validation & half, ~validation & ~half) for half in (is_odd, ~is_odd)]
        for test, fit in parts:
            if test.any():
                fit = fit if fit.any() else test
                expected_ious[test] = predict(fit, test)
        return expected_ious

    def _fit(self, rows: np.ndarray) -> ExpectedOverlap:
        return ExpectedOverlap.fitted(CUES, self.cues[rows], self.iou[rows])

    @cached_property
    def fitted(self) -> ExpectedOverlap | None:
        """To all objects that aren't of validation families; None without any."""
        rows = ~self.is_validation
        return self._fit(rows) if rows.any() else None

    def rows_of(self, family: str | None = None) -> np.ndarray:
        """(N,) which objects are of a family; None: all that aren't of validation families."""
        if family is None:
            return ~self.is_validation
        return np.array([item.family == family for item in self.objects], dtype=bool)

    def score(self, way: str, name: str, rows: np.ndarray) -> Interval:
        """With bootstrap bounds, over images, but over objects of groups and ranks."""
        expected, iou = self.expected[way][rows], self.iou[rows]
        if name in ("gap", "rank"):
            return _resampled(_gap if name == "gap" else _rank, expected, iou)
        off = expected - iou
        constant = self.expected.get(CONSTANT, np.full(len(rows), self.iou.mean()))[rows] - iou
        statistic: dict[str, Callable[[Float64], Float64]] = {
            "bias": lambda m: m[..., 0],
            "error": lambda m: np.sqrt(m[..., 1]),
            "skill": lambda m: 1 - m[..., 1] / np.maximum(m[..., 2], 1e-12),
        }
        columns = np.stack([off, off**2, constant**2], axis=1)
        return bootstrap_interval(columns, self.images[rows].tolist(), statistic[name])

    @cached_property
    def figures(self) -> dict[str, float]:
        """Facts and `<way>/<score>`, with bounds; those of a family begin with its name."""
        figures: dict[str, float] = {}
        for family in (None, *self.families):
            rows, prefix = self.rows_of(family), "" if family is None else f"{family}/"
            figures[f"{prefix}objects"] = float(rows.sum())
            figures[f"{prefix}images"] = float(len(np.unique(self.images[rows])))
            if not rows.any():
                continue
            figures[f"{prefix}iou"] = float(self.iou[rows].mean())
            for way in self.expected:
                for name in SCORES:
                    score = self.score(way, name, rows)
                    ends = {"": score.mean, LOW: score.low, HIGH: score.high}
                    named = {f"{prefix}{way}/{name}{end}": v for end, v in ends.items()}
                    figures |= {key: v for key, v in named.items() if np.isfinite(v)}
        return figures

    @property
    def measures(self) -> dict[str, Measure]:
        """Units and digits."""
        ways = {
            f"{way}/{name}": measure for way in self.expected for name, measure in SCORES.items()
        }
        prefixes = ("", *(f"{family}/" for family in self.families))
        return {
            f"{p}{name}": measure for p in prefixes for name, measure in (_FACTS | ways).items()
        }


def equal_groups(expected: Float64) -> list[np.ndarray]:
    """Rows in groups of equal size, by their expected IoU."""
    return np.array_split(expected.argsort(kind="stable"), _group_count(len(expected)))


def _group_count(objects: int) -> int:
    return max(min(_GROUPS, objects // _MIN_GROUP), 1)


def _gap(expected: Float64, iou: Float64, axis: int = -1) -> Float64:
    order = expected.argsort(axis=axis, kind="stable")
    count = _group_count(expected.shape[axis])
    expected_groups, iou_groups = (
        np.array_split(np.take_along_axis(values, order, axis), count, axis)
        for values in (expected, iou)
    )
    gaps = [
        e.shape[axis] * abs(e.mean(axis=axis) - i.mean(axis=axis))
        for e, i in zip(expected_groups, iou_groups, strict=True)
    ]
    return np.asarray(sum(gaps) / expected.shape[axis])


def _rank(expected: Float64, iou: Float64, axis: int = -1) -> Float64:
    if expected.shape[axis] < _MIN_RANKED:
        return np.array(np.nan)
    ranks = [stats.rankdata(values, axis=axis) for values in (expected, iou)]
    centred_ranks = np.stack([rank - rank.mean(axis=axis, keepdims=True) for rank in ranks])
    squares = (centred_ranks**2).sum(axis=axis).prod(axis=0)
    with np.errstate(invalid="ignore"):  # equal values have no correlation
        return np.asarray(centred_ranks.prod(axis=0).sum(axis=axis) / np.sqrt(squares))


def _resampled(
    statistic: Callable[[Float64, Float64], Float64], expected: Float64, iou: Float64
) -> Interval:
    value = float(statistic(expected, iou))
    if len(iou) < _MIN_RANKED or not np.isfinite(value):
        return Interval(value, float("nan"), float("nan"), len(iou))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of resamples of equal values
        interval = stats.bootstrap(
            (expected, iou), statistic, paired=True, vectorized=True, n_resamples=_RESAMPLES,
            method="percentile", rng=np.random.default_rng(0),
        ).confidence_interval  # fmt: skip
    return Interval(value, float(interval.low), float(interval.high), len(iou))
