"""Means over few scenes with confidence bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
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
