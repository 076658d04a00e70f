"""What a rule without learning can know of a height map: connected components and their boxes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError

Array = NDArray[np.float64]
Row = tuple[str, float, str | int, str | int]
"""A question: feature, threshold, and what follows below it and from it on, a class or a row."""

FEATURES = ("top", "mean", "length", "width", "rectangle", "fill")
"""Greatest and mean height, sides (m) and area (m^2) of the least rectangle, share that is full."""


def components(
    heights: NDArray[np.float32], level: float, spacing: float
) -> tuple[NDArray[np.int32], Array]:
    """Components of vertices above `level` (V, V), 0 = none, and their features (N, FEATURES).

    Vertices touch across corners too; NaN counts as low.
    """
    number, _ = ndimage.label(np.nan_to_num(heights) > level, np.ones((3, 3)))
    features = []
    for k, where in enumerate(ndimage.find_objects(number), 1):
        inside = number[where] == k
        high = heights[where][inside]
        long, short = _rectangle(np.argwhere(inside).astype(np.float64)) * spacing
        area = long * short
        fill = len(high) * spacing**2 / area
        features.append([float(high.max()), float(high.mean()), long, short, area, fill])
    return number, np.array(features, dtype=np.float64).reshape(-1, len(FEATURES))


def answers(features: Array, rows: Sequence[Row]) -> list[str]:
    """The class of each component (N, FEATURES) by a tree of questions that begins at row 0."""
    classes = []
    for feature in features:
        at: str | int = 0
        while isinstance(at, int):
            name, threshold, below, above = rows[at]
            at = below if feature[FEATURES.index(name)] < threshold else above
        classes.append(at)
    return classes


def fitted(features: Array, weights: Array, classes: Sequence[str], leaves: int = 16) -> list[Row]:
    """The questions that part components best (CART; Breiman et al. 1984), the best one first.

    Args:
        features: (N, FEATURES) of components.
        weights: (N, C) how much of each class a component holds; their sums weigh classes.
        classes: C names.
        leaves: answers at most.
    """
    waiting = [_best_split(features, weights, np.arange(len(features)))]
    rows: list[list[str | float | int]] = []
    parents: list[tuple[int, int]] = [(-1, 0)]
    while waiting and len(rows) < leaves - 1:
        best = int(np.argmax([gain for gain, *_ in waiting]))
        gain, column, threshold, inside = waiting.pop(best)
        parent, side = parents.pop(best)
        if gain <= 0:
            break
        if parent >= 0:
            rows[parent][side] = len(rows)
        below = features[inside, column] < threshold
        halves = (inside[below], inside[~below])
        named = [classes[int(weights[half].sum(axis=0).argmax())] for half in halves]
        rows.append([FEATURES[column], round(threshold, 5), *named])
        for place, half in zip((2, 3), halves, strict=True):
            waiting.append(_best_split(features, weights, half))
            parents.append((len(rows) - 1, place))
    return [(str(name), float(at), below, above) for name, at, below, above in rows]  # type: ignore[misc]


def _best_split(
    features: Array, weights: Array, inside: NDArray[np.int64]
) -> tuple[float, int, float, NDArray[np.int64]]:
    """Gain, feature and threshold of the cut that lowers the Gini impurity most."""
    best = (0.0, 0, 0.0, inside)
    parent_purity = _purity(weights[inside].sum(axis=0))
    for column in range(features.shape[1]):
        order = inside[np.argsort(features[inside, column], kind="stable")]
        value, running = features[order, column], weights[order].cumsum(axis=0)
        gain = _purity(running[:-1]) + _purity(running[-1] - running[:-1]) - parent_purity
        gain = np.where(np.diff(value) > 1e-9, gain, -1.0)
        if len(gain) and gain.max() > best[0]:
            at = int(gain.argmax())
            best = (float(gain[at]), column, float(value[at : at + 2].mean()), inside)
    return best


def _purity(counts: Array) -> Array:
    """Weight times one minus Gini's impurity, of rows (..., C)."""
    total = np.maximum(counts.sum(axis=-1), 1e-12)
    return np.asarray((counts**2).sum(axis=-1) / total)


def _rectangle(points: Array) -> Array:
    """Longer and shorter side (2,) of the least rectangle about vertices (P, 2)."""
    if len(points) < 3:  # noisy maps have thousands of these
        return _upright(points)
    try:
        points = points[ConvexHull(points).vertices]
    except QhullError:  # all on a line
        return _upright(points)
    sides = np.diff(np.concatenate([points, points[:1]]), axis=0)
    angle = np.unique(np.arctan2(sides[:, 1], sides[:, 0]) % (np.pi / 2))
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = points.T
    extents = np.stack([np.ptp(c * x + s * y, axis=1), np.ptp(c * y - s * x, axis=1)], axis=1) + 1
    return np.sort(extents[extents.prod(axis=1).argmin()])[::-1]


def _upright(points: Array) -> Array:
    """Longer and shorter side (2,) of the rectangle about vertices that is along the axes."""
    return np.sort(np.ptp(points, axis=0) + 1)[::-1]
