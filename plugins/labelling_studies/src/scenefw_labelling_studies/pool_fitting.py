"""Weights of the hybrid's pool by maximum likelihood.

The regularised log-likelihood is strictly concave in the weights, so they are unique.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize

from scenefw.core.errors import InputError
from scenefw.labelling.pooling import (
    DOUBT,
    Pool,
    Weights,
    ends,
    features_of,
    nested,
    uninformative_distributions,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Int32

_LARGEST = 20.0  # bound of weights and biases
_PRIOR = 1e-4  # pulls weights that no vertex constrains towards 0


def fit_pool(
    views: Float32,
    of_map: Float32,
    well: Float32,
    truth: Int32,
    drawn_for: Int32 | None = None,
    doubt: float = DOUBT,
) -> Pool:
    """Weights of least negative log-likelihood of the true classes, each class counting the same.

    Classes count the same because the mean IoU that strategies are compared by gives a small class
    as much influence as the surface. The likelihood is a product of that of surface or object, over
    all vertices, and of that of the class, over those of objects, so that each is fitted alone.

    Args:
        views: (C, N) of vertices of scenes that no test uses.
        of_map: (C, N).
        well: (N,).
        truth: (N,) class ids.
        drawn_for: (N,) the class that a vertex was drawn for and counts towards; None: its own.
        doubt: of the pool.

    Raises:
        InputError: there is no vertex.
    """
    if not len(truth):
        raise InputError("no vertex to calibrate on; give scenes with true labels that are seen")
    counted = truth if drawn_for is None else drawn_for
    counts = np.bincount(counted, minlength=len(views))
    share = 1 / counts[counted] / np.count_nonzero(counts)
    (views_gate, views_objects), (map_gate, map_objects) = nested(views), nested(of_map)
    of_object = truth > 0
    unknown, any_object = uninformative_distributions(len(views))
    gate = features_of(views_gate, map_gate, doubt, unknown)
    objects = features_of(views_objects[:, of_object], map_objects[:, of_object], doubt, any_object)
    object_classes = truth[of_object].astype(np.intp) - 1
    return Pool(
        _fit(gate, well, unknown, of_object.astype(np.intp), share),
        _fit(objects, well[of_object], any_object, object_classes, share[of_object], biased=False),
        doubt,
    )


def _fit(
    features: Float32,
    well: Float32,
    uninformative: Float32,
    truth: NDArray[np.intp],
    share: NDArray[np.float64],
    *,
    biased: bool = True,
) -> Weights:
    """Weights of one pool of least negative log-likelihood, vertices counting their shares."""
    terms = (features[:, None] * ends(well)[:, None]).reshape(6, *features.shape[1:])
    of_truth = np.take_along_axis(terms, truth[None, None], axis=1)[:, 0]
    offset = np.log(uninformative)[:, None]

    def loss(values: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        scores = np.tensordot(values.astype(np.float32), terms, axes=1) + offset
        right = np.take_along_axis(scores, truth[None], axis=0)[0]
        largest = scores.max(axis=0)
        likelihood = np.exp(scores - largest)
        total = likelihood.sum(axis=0)
        likelihood /= total
        fit = share @ (largest + np.log(total) - right)
        mean = np.einsum("kcn,cn->kn", terms, likelihood)
        slope = (mean - of_truth) @ share + 2 * _PRIOR * values
        return float(fit + _PRIOR * values @ values), slope

    bias = _LARGEST if biased else 0.0
    bounds = [(0.0, _LARGEST)] * 4 + [(-bias, bias)] * 2
    solution = minimize(loss, np.zeros(6), jac=True, method="L-BFGS-B", bounds=bounds)
    return Weights(*(float(value) for value in solution.x))
