"""Means over few scenes with confidence bounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats


@dataclass(frozen=True)
class Interval:
    """A mean with confidence bounds.

    Args:
        mean: of the values.
        low, high: bounds; NaN where there are fewer than two values.
        count: of values.
    """

    mean: float
    low: float
    high: float
    count: int


def mean_interval(values: ArrayLike, confidence: float = 0.95) -> Interval:
    """Mean of independent values and Student's t bounds for it; NaN values are left out.

    Args:
        values: (N,), e.g. one per scene.
        confidence: probability in (0, 1) that the bounds hold the true mean.
    """
    array = np.asarray(values, dtype=np.float64)
    array = array[np.isfinite(array)]
    count = len(array)
    if count == 0:
        return Interval(float("nan"), float("nan"), float("nan"), 0)
    mean = float(array.mean())
    if count == 1:
        return Interval(mean, float("nan"), float("nan"), 1)
    reach = stats.t.ppf(0.5 + confidence / 2, count - 1) * array.std(ddof=1) / np.sqrt(count)
    return Interval(mean, mean - float(reach), mean + float(reach), count)


def paired_interval(ours: ArrayLike, theirs: ArrayLike, confidence: float = 0.95) -> Interval:
    """Mean of the differences `ours - theirs` of the same scenes, with bounds.

    Narrower than the bounds of the two means, as scenes that are hard are so for both.
    """
    return mean_interval(np.asarray(ours) - np.asarray(theirs), confidence)


def bootstrap_interval(
    values: ArrayLike,
    scenes: Sequence[int],
    statistic: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    confidence: float = 0.95,
    resamples: int = 2000,
) -> Interval:
    """A function of means over scenes with percentile bounds (Efron 1979), scenes drawn anew.

    Views of a scene are averaged first, so that scenes count alike. Rows with a NaN are left out.
    The draws are always the same: methods on the same scenes are compared on the same draws.

    Args:
        values: (N, Q) of views.
        scenes: (N,) to which they belong.
        statistic: from means (..., Q) to (...).
        confidence: probability in (0, 1) of the bounds.
        resamples: how often scenes are drawn.
    """
    array, owners = np.asarray(values, dtype=np.float64), np.asarray(scenes)
    valid = np.isfinite(array).all(axis=1)
    _, place = np.unique(owners[valid], return_inverse=True)
    count = int(place.max(initial=-1)) + 1
    if not count:
        return Interval(float("nan"), float("nan"), float("nan"), 0)
    sums = np.zeros((count, array.shape[1]))
    np.add.at(sums, place, array[valid])
    means = sums / np.bincount(place)[:, None]
    estimate = float(statistic(means.mean(axis=0)))
    if count == 1:
        return Interval(estimate, float("nan"), float("nan"), 1)
    replicates = statistic(_redrawn(count, resamples) @ means / count)
    low, high = np.quantile(replicates, [0.5 - confidence / 2, 0.5 + confidence / 2])
    return Interval(estimate, float(low), float(high), count)


def median_interval(
    values: ArrayLike, scenes: Sequence[int], confidence: float = 0.95, resamples: int = 2000
) -> Interval:
    """Median over views with percentile bounds, whole scenes drawn anew (Efron 1979).

    Args:
        values: (N,) of views; NaN values are left out.
        scenes: (N,) to which they belong.
        confidence: probability in (0, 1) of the bounds.
        resamples: how often scenes are drawn.
    """
    array, owners = np.asarray(values, dtype=np.float64), np.asarray(scenes)
    valid = np.isfinite(array)
    array, place = array[valid], np.unique(owners[valid], return_inverse=True)[1]
    if not len(array):
        return Interval(float("nan"), float("nan"), float("nan"), 0)
    count = int(place.max()) + 1
    estimate = float(np.median(array))
    if count == 1:
        return Interval(estimate, float("nan"), float("nan"), 1)
    order = np.argsort(array, kind="stable")
    weights = _redrawn(count, resamples)[:, place[order]].cumsum(axis=1)
    middle = (weights >= weights[:, -1:] / 2).argmax(axis=1)
    low, high = np.quantile(array[order][middle], [0.5 - confidence / 2, 0.5 + confidence / 2])
    return Interval(estimate, float(low), float(high), count)


@lru_cache(maxsize=8)
def _redrawn(count: int, resamples: int) -> NDArray[np.float64]:
    """How often each of `count` scenes is drawn in each resample, always the same."""
    multiplicities = np.random.default_rng(0).multinomial(
        count, np.full(count, 1 / count), size=resamples
    )
    return multiplicities.astype(np.float64)
