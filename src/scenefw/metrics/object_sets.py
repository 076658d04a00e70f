"""Distances between sets of objects, and samples of such sets judged as samples."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from scenefw.core.errors import InputError

Float64 = NDArray[np.float64]


class LabelSets:
    """Labellings of the same voxels, whose instances are compared all with all in one product.

    Args:
        labellings: S arrays of one shape, 0 = no object, numbered in any way.

    Raises:
        InputError: there is none, or shapes differ.
    """

    def __init__(self, labellings: Sequence[NDArray[np.integer]]) -> None:
        arrays = [np.asarray(labelling) for labelling in labellings]
        if not arrays or any(array.shape != arrays[0].shape for array in arrays):
            raise InputError("give at least one labelling, all of the same voxels")
        flat = np.stack([array.ravel() for array in arrays])
        flat = flat[:, flat.any(axis=0)]
        members = [row == label for row in flat for label in np.unique(row[row > 0])]
        counts = [len(np.unique(row[row > 0])) for row in flat]
        self._ends = np.concatenate([[0], np.cumsum(counts)])
        masks = np.array(members, dtype=np.float32).reshape(len(members), flat.shape[1])
        shared = (masks @ masks.T).astype(np.float64)
        sizes = np.diag(shared)
        self._iou = shared / np.maximum(sizes[:, None] + sizes[None] - shared, 1.0)

    def iou(self, first: int, second: int) -> Float64:
        """Intersection over union (P, Q) of the instances of two labellings, labels ascending."""
        a, b = (slice(self._ends[i], self._ends[i + 1]) for i in (first, second))
        return self._iou[a, b]

    def distance(self, first: int, second: int) -> float:
        """`set_distance` of two labellings."""
        return set_distance(self.iou(first, second))

    def distances(self, indices: Sequence[int]) -> Float64:
        """Distances (N, N) among some labellings."""
        distances = np.zeros((len(indices), len(indices)))
        for i, first in enumerate(indices):
            for j in range(i):
                distances[i, j] = distances[j, i] = self.distance(first, indices[j])
        return distances


def set_distance(iou: Float64) -> float:
    """1 - (sum of the IoUs of matched pairs) / (number of objects of the larger set), in [0, 1].

    It is a metric: OSPA of order 1 and cut-off 1 (Schuhmacher, Vo and Vo 2008) on the Jaccard
    distance 1 - IoU. Two empty sets are 0 apart.

    Args:
        iou: (P, Q) of all pairs.
    """
    larger = max(iou.shape)
    if larger == 0:
        return 0.0
    rows, columns = linear_sum_assignment(-iou)
    return float(1 - iou[rows, columns].sum() / larger)


def energy_score(to_truth: Float64, among: Float64) -> float:
    """Energy score E d(X, truth) - E d(X, X') / 2 (Gneiting and Raftery 2007); 0 is perfect.

    The second mean is over pairs of different samples, which makes it unbiased for independent
    samples. One sample, or several equal ones, score their distance to the truth.

    Args:
        to_truth: (S,) distances of the samples to the truth.
        among: (S, S) distances among samples, 0 on the diagonal.
    """
    samples = len(to_truth)
    spread = among.sum() / (samples * (samples - 1)) if samples > 1 else 0.0
    return float(np.mean(to_truth) - spread / 2)
