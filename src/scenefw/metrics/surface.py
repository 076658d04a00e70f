"""How near two surfaces are, from points sampled on both: Chamfer, F-score, normals.

Chamfer distances from n random points have a floor: two samplings of one surface of area A are
sqrt(A / n) apart in the summed measure, whatever the method (each direction averages 0.5 sqrt(A /
n), the mean distance to the nearest of n points spread over A). Print it beside the distance.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from scenefw.core.errors import InputError
from scenefw.metrics.sampling import SurfacePoints

Float64 = NDArray[np.float64]


class Nearest(NamedTuple):
    """Distances (m) from each point to the nearest of the other set, and which that is."""

    forward: Float64
    backward: Float64
    forward_index: NDArray[np.int64]
    backward_index: NDArray[np.int64]


def nearest(predicted: Float64, true: Float64) -> Nearest:
    """Nearest neighbours both ways between points (P, 3) and (T, 3): forward = predicted to true.

    Raises:
        InputError: a set is empty, or not (N, 3).
    """
    for name, points in (("predicted", predicted), ("true", true)):
        if points.ndim != 2 or points.shape[1] != 3 or not len(points):
            raise InputError(
                f"{name} points have shape {points.shape}, expected (N, 3) with N >= 1"
            )
    trees = cKDTree(predicted), cKDTree(true)
    (forward, forward_index), (backward, backward_index) = _among(*trees), _among(*reversed(trees))
    return Nearest(forward, backward, forward_index, backward_index)


def _among(points: cKDTree, targets: cKDTree) -> tuple[Float64, NDArray[np.int64]]:
    """Distance from each point to the nearest of others, and which that is.

    In the order of their tree neighbours are asked for together, and their branches are cached.
    """
    distances, indices = np.empty(points.n), np.empty(points.n, np.int64)
    order = points.indices
    distances[order], indices[order] = targets.query(points.data[order], workers=-1)
    return distances, indices


def chamfer(predicted: Float64, true: Float64) -> float:
    """Chamfer distance in metres: mean Euclidean distances, both directions summed (eq. 5.16)."""
    return chamfer_of(nearest(predicted, true))


def chamfer_of(neighbours: Nearest) -> float:
    """Chamfer distance of nearest neighbours already found."""
    return float(neighbours.forward.mean() + neighbours.backward.mean())


def f_score(neighbours: Nearest, threshold: float) -> float:
    """Harmonic mean of the shares of points of either set within `threshold` (m) of the other."""
    precision = float((neighbours.forward <= threshold).mean())
    recall = float((neighbours.backward <= threshold).mean())
    return 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0


def normal_consistency(predicted: SurfacePoints, true: SurfacePoints, neighbours: Nearest) -> float:
    """Mean cosine between the normals of nearest points, both directions averaged, in [-1, 1]."""
    forward = (predicted.normals * true.normals[neighbours.forward_index]).sum(axis=1)
    backward = (true.normals * predicted.normals[neighbours.backward_index]).sum(axis=1)
    return float(0.5 * (forward.mean() + backward.mean()))
