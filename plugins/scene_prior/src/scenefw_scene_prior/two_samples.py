"""Whether two samples are of one distribution: energy distance, its bounds, a permutation test."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist

from scenefw.evaluation.statistics import Interval

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_NAN = float("nan")


def energy_distance(
    first: Array, second: Array, confidence: float = 0.95, resamples: int = 1000
) -> Interval:
    """2 E|X - Y| - E|X - X'| - E|Y - Y'|, which is 0 for equal distributions (Szekely, Rizzo 2013).

    Without bias, so it may be below 0. Bounds are percentiles over rows drawn anew (Efron 1979); a
    row and its copy are no pair. The draws are always the same.

    Args:
        first: (N, D) rows.
        second: (M, D) rows.
        confidence: probability in (0, 1) of the bounds.
        resamples: how often rows are drawn.

    Returns:
        NaN where a sample has fewer than two rows.
    """
    sizes = len(first), len(second)
    if min(sizes) < 2:
        return Interval(_NAN, _NAN, _NAN, min(sizes))
    random = np.random.default_rng(0)
    x, y = (
        random.multinomial(size, np.full(size, 1 / size), resamples).astype(np.float64)
        for size in sizes
    )
    between, within_x, within_y = cdist(first, second), cdist(first, first), cdist(second, second)
    mean = _energy(np.ones_like(x[:1]), np.ones_like(y[:1]), between, within_x, within_y)[0]
    replicates = _energy(x, y, between, within_x, within_y)
    low, high = np.quantile(replicates, [0.5 - confidence / 2, 0.5 + confidence / 2])
    return Interval(float(mean), float(low), float(high), min(sizes))


def permutation_test(first: Array, second: Array, resamples: int = 1000) -> float:
    """Probability of so large an energy distance where rows are dealt out by chance; NaN if few.

    Args:
        first: (N, D) rows.
        second: (M, D) rows.
        resamples: how often they are dealt out. The deals are always the same.
    """
    if min(len(first), len(second)) < 2:
        return _NAN
    rows = np.concatenate([first, second])
    gaps = cdist(rows, rows)
    random = np.random.default_rng(0)
    order = np.argsort(random.random((resamples, len(rows))), axis=1)
    order[0] = np.arange(len(rows))  # as it is
    membership = (order < len(first)).astype(np.float64)
    energies = _energy(membership, 1 - membership, gaps, gaps, gaps)
    return float((energies >= energies[0] - 1e-12).mean())


def _energy(x: Array, y: Array, between: Array, within_x: Array, within_y: Array) -> Array:
    """Of rows as often as weights (R, N) and (R, M) say."""
    across = ((x @ between) * y).sum(axis=1) / (x.sum(axis=1) * y.sum(axis=1))
    return np.asarray(2 * across - _spread(x, within_x) - _spread(y, within_y))


def _spread(weights: Array, gaps: Array) -> Array:
    """Mean distance (R,) of pairs of different rows."""
    pairs = weights.sum(axis=1) ** 2 - (weights**2).sum(axis=1)
    return np.asarray(((weights @ gaps) * weights).sum(axis=1) / np.maximum(pairs, 1e-12))
