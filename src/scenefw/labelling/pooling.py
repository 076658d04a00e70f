"""Two experts' probabilities of a vertex made one: a logarithmic opinion pool with learnt weights.

The pool multiplies the experts' calibrated distributions (Genest and Zidek 1986; products of
experts, Hinton 2002):

    p(c) ~ v(c)^a m(c)^b,    v = (1 - e) views + e / C,    m = (1 - f) map + f / C

where a and b are inverse temperatures (Guo et al. 2017) and e and f say how often an expert is
wrong when it is sure: fused views repeat one network's mistake, so that their product is far too
sure of it. Both temperatures go from one value to another with how well the map is reconstructed
about the vertex, since that is what a network that reads the map depends on.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.optimize import minimize

from scenefw.core.errors import ConfigError, InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.height_maps import HeightMap
    from scenefw.core.types import Float32, Int32

_LARGEST = 20.0  # of the weights that calibration tries
_PRIOR = 1e-3  # pulls weights that vertices say little about towards 1
_LEAST_DOUBT, _MOST_DOUBT = 1e-6, 0.5


@dataclass(frozen=True)
class Weights:
    """Inverse temperatures and doubts of both experts.

    Args:
        views_poor: weight of fused views where the map is poorly reconstructed.
        views_well: the same where it is well reconstructed.
        map_poor: weight of the map's labels where it is poorly reconstructed.
        map_well: the same where it is well reconstructed.
        views_doubt: share of uniform in the views' distribution.
        map_doubt: the same of the map's.
    """

    views_poor: float = 1.0
    views_well: float = 1.0
    map_poor: float = 0.0
    map_well: float = 1.0
    views_doubt: float = 0.01
    map_doubt: float = 0.01

    def __post_init__(self) -> None:
        wrong = [value for value in astuple(self)[:4] if not value >= 0]
        doubts = (self.views_doubt, self.map_doubt)
        if wrong or not all(0 < doubt < 1 for doubt in doubts):
            raise ConfigError(
                f"{self} can't be used; expected weights of 0 or more and doubts between 0 and 1"
            )


_STARTS = (Weights(), Weights(1.0, 1.0, 0.2, 0.2), Weights(0.2, 0.2, 1.0, 1.0))
"""Of the descent, which has local minima where an expert has no weight."""


class Reconstruction:
    """How well a map is reconstructed about each vertex, from 0 to 1.

    The mean, over the network's receptive field, of c / (c + c0) * s0^2 / (s^2 + s0^2), with c the
    confidence and s^2 the variance of a vertex, and 0 where it is unseen: the share of its context
    that a network sees, with vertices counting as much as they can be relied on.

    Args:
        confidence: c0, at which a vertex counts half (sum of weights of measurements).
        deviation: s0, at which a vertex counts half (m).
        window: side of the receptive field (vertices).
    """

    def __init__(self, confidence: float = 1.0, deviation: float = 0.003, window: int = 91) -> None:
        if not (confidence > 0 and deviation > 0 and window >= 1):
            raise ConfigError(
                f"confidence = {confidence}, deviation = {deviation}, window = {window}; expected "
                "values above 0"
            )
        self.confidence = confidence
        self.deviation = deviation
        self.window = window

    def of(self, height_map: HeightMap) -> Float32:
        """(V, V) float32 in [0, 1]."""
        sure = height_map.confidence / (height_map.confidence + self.confidence)
        limit = np.float32(self.deviation**2)
        spread = np.nan_to_num(height_map.variance, nan=0.0, posinf=np.inf)
        reliable = np.where(height_map.seen, sure * limit / (spread + limit), 0).astype(np.float32)
        size = min(self.window, *reliable.shape)
        smooth: Float32 = uniform_filter(reliable, size, mode="nearest").clip(0, 1)
        return smooth


def pool(views: Float32, of_map: Float32, well: Float32, weights: Weights) -> Float32:
    """Pooled probabilities (C, ...) float32; an expert that is uniform has no say.

    Args:
        views: (C, ...) of fused views.
        of_map: (C, ...) of the map's labels.
        well: (...) in [0, 1], see `Reconstruction`.
        weights: of the pool.
    """
    scores = _scores(views, of_map, well, weights)
    scores -= scores.max(axis=0)
    np.exp(scores, out=scores)
    scores /= scores.sum(axis=0)
    return scores


def fit_weights(
    views: Float32, of_map: Float32, well: Float32, truth: Int32, drawn_for: Int32 | None = None
) -> Weights:
    """Weights of least negative log-likelihood of the true classes, each class counting the same.

    Classes count the same because the mean IoU that strategies are compared by gives a small class
    as much say as the surface.

    Args:
        views: (C, N) of vertices of scenes that are not tested on.
        of_map: (C, N).
        well: (N,).
        truth: (N,) class ids.
        drawn_for: (N,) the class that a vertex was drawn for and counts to; None: its true one.

    Raises:
        InputError: there is no vertex.
    """
    if not len(truth):
        raise InputError("no vertex to calibrate on; give scenes with true labels that are seen")
    counted = truth if drawn_for is None else drawn_for
    counts = np.bincount(counted, minlength=len(views))
    share = 1 / counts[counted] / np.count_nonzero(counts)

    def loss(values: NDArray[np.float64]) -> float:
        pooled = pool(views, of_map, well, Weights(*values))
        likelihood = np.take_along_axis(pooled, truth[None], axis=0)[0]
        fit = -(share * np.log(np.maximum(likelihood, 1e-12))).sum()
        return float(fit + _PRIOR * np.square(values[:4] - 1).sum())

    bounds = [(0.0, _LARGEST)] * 4 + [(_LEAST_DOUBT, _MOST_DOUBT)] * 2
    found = [
        minimize(loss, astuple(start), method="L-BFGS-B", bounds=bounds, options={"eps": 1e-4})
        for start in _STARTS
    ]
    best = min(found, key=lambda result: float(result.fun))
    return Weights(*(float(value) for value in best.x))


def disagreement(views: Float32, of_map: Float32, pooled: Float32) -> Sequence[NDArray[np.bool_]]:
    """Where the pooled class (...) is that of the views, and where it is that of the map."""
    winner = pooled.argmax(axis=0)
    return views.argmax(axis=0) == winner, of_map.argmax(axis=0) == winner


def _scores(views: Float32, of_map: Float32, well: Float32, weights: Weights) -> Float32:
    a = weights.views_poor + (weights.views_well - weights.views_poor) * well
    b = weights.map_poor + (weights.map_well - weights.map_poor) * well
    scores: Float32 = _doubted(views, weights.views_doubt)
    scores *= a.astype(np.float32)
    other = _doubted(of_map, weights.map_doubt)
    other *= b.astype(np.float32)
    scores += other
    return scores


def _doubted(probabilities: Float32, doubt: float) -> Float32:
    """Log of the distribution mixed with the uniform one."""
    mixed = probabilities * np.float32(1 - doubt)
    mixed += np.float32(doubt / len(probabilities))
    return np.log(mixed, out=mixed)
