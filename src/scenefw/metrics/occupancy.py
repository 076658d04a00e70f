"""Occupied space from several samples: cross entropies, overlap, and how honest the spread is."""

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError

Float = NDArray[np.floating]
Bool = NDArray[np.bool_]

_LEAST_LOG = -100.0  # as torch.nn.functional.binary_cross_entropy


def expected_occupancy(samples: Float) -> Float:
    """Mean of hard occupancies (tsdf < 0) over samples (S, ...)."""
    return (np.asarray(samples) < 0).mean(axis=0)


def probable_occupancy(samples: Float, width: float) -> Float:
    """Mean over samples (S, ...) of 1 / (1 + exp(tsdf / width)): a distance says how sure it is.

    Args:
        samples: signed distances (m).
        width: distance (m) at which the odds are e to 1; half a voxel suits a network's blur.
    """
    return (0.5 - 0.5 * np.tanh(np.asarray(samples) / (2 * width))).mean(axis=0)


def binary_cross_entropy(probability: Float, truth: Bool) -> float:
    """Eq. 5.17: mean of -[y log p + (1 - y) log(1 - p)] over voxels, logs cut at -100 (nats)."""
    probability, truth = np.asarray(probability, dtype=np.float64), np.asarray(truth, dtype=bool)
    if probability.shape != truth.shape:
        raise InputError(
            f"probabilities {probability.shape} and truth {truth.shape} differ in shape"
        )
    with np.errstate(divide="ignore"):
        logs = np.log(np.where(truth, probability, 1 - probability))
    return float(-np.maximum(logs, _LEAST_LOG).mean())


def occupancy_iou(predicted: Bool, truth: Bool) -> float:
    """Intersection over union of occupied voxels; 1 if both are empty."""
    union = np.count_nonzero(predicted | truth)
    return np.count_nonzero(predicted & truth) / union if union else 1.0


def coverage(samples: Float, truth: Float, where: Bool) -> float:
    """Share of voxels whose true distance lies between the least and the greatest of the samples.

    Independent samples of the true distribution cover it in (S - 1) / (S + 1) of the voxels, as
    S + 1 values are exchangeable; coupled ones, which are further apart, cover it more often. NaN
    where there are no voxels.

    Args:
        samples: (S, X, Y, Z) signed distances.
        truth: (X, Y, Z).
        where: voxels that count: hidden ones, whose truth is not cut off.
    """
    if not where.any():
        return float("nan")
    samples, truth = np.asarray(samples)[:, where], np.asarray(truth)[where]
    return float(((samples.min(axis=0) <= truth) & (truth <= samples.max(axis=0))).mean())
