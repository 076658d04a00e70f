"""Overlap and boundary measures of instance masks in one image (UOIS-Net-3D, Xie et al. 2021)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from scenefw.core.errors import InputError
from scenefw.matching.assignment import Assignment

Labels = NDArray[np.integer]
Masks = NDArray[np.bool_]


@dataclass(frozen=True)
class MaskScores:
    """Scores of one image, all in [0, 1] but the two counts.

    Args:
        overlap_precision: matched intersections / predicted object pixels.
        overlap_recall: matched intersections / true object pixels.
        overlap_f: their harmonic mean.
        boundary_precision, boundary_recall, boundary_f: the same of the masks' borders.
        objects_f75: share of true objects whose matched mask has F >= 0.75.
        predicted: number of predicted objects.
        true: number of true objects.
    """

    overlap_precision: float
    overlap_recall: float
    overlap_f: float
    boundary_precision: float
    boundary_recall: float
    boundary_f: float
    objects_f75: float
    predicted: int
    true: int

    @property
    def count_error(self) -> int:
        """How many objects too many or too few."""
        return abs(self.predicted - self.true)


def mask_scores(predicted: Labels, true: Labels, tolerance: float = 0.003) -> MaskScores:
    """Scores predicted instance labels against true ones.

    F of every pair of masks, one-to-one assignment of greatest total F, then sums over the matched
    pairs (those that share a pixel). As in the published code: without any prediction precision is
    1 and recall 0, without any true object the other way round, and all is 1 where neither has any.

    Args:
        predicted: (H, W) labels, <= 0 where no object.
        true: (H, W) labels, 0 = no object, -1 = unknown: such pixels count for nothing.
        tolerance: borders match within ceil(tolerance * image diagonal) pixels.

    Raises:
        InputError: the two images differ in size.
    """
    require_one_size(predicted, true)
    ours = _masks(np.where(true < 0, 0, predicted))
    theirs = _masks(true)
    if not len(ours) or not len(theirs):
        return _without_pairs(len(ours), len(theirs))
    overlap = _products(ours, theirs)
    f = 2 * overlap / (ours.sum((1, 2))[:, None] + theirs.sum((1, 2))[None, :])
    i, j = Assignment().assign(-f).T
    pairs = i[f[i, j] > 0], j[f[i, j] > 0]  # masks apart are left over, no pair
    hits, true_hits = _boundary_matches(ours, theirs, pairs, radius(true, tolerance))
    return MaskScores(
        *_precision_recall_f(overlap[pairs].sum(), ours.sum(), overlap[pairs].sum(), theirs.sum()),
        *_precision_recall_f(hits, borders(ours).sum(), true_hits, borders(theirs).sum()),
        objects_f75=float((f[pairs] >= 0.75).sum() / len(theirs)),
        predicted=len(ours),
        true=len(theirs),
    )


def radius(labels: Labels, tolerance: float) -> int:
    """Pixels of a tolerance, given as a share of the image diagonal."""
    return math.ceil(tolerance * math.hypot(*labels.shape))


def require_one_size(predicted: Labels, true: Labels) -> None:
    """Raises an InputError unless both are images (H, W) of one size."""
    if predicted.shape != true.shape or true.ndim != 2:
        raise InputError(
            f"predicted labels {predicted.shape} and true labels {true.shape} must be images of "
            "one size; predict on the image that was labelled"
        )


def borders(masks: Masks) -> Masks:
    """Border pixels of masks (..., H, W), one pixel wide (Martin et al. 2004).

    A pixel is on the border if its right, lower or diagonal neighbour differs from it: the line
    passes outside of a mask's left and upper sides, inside of its right and lower ones.
    """
    padded = np.pad(masks, [(0, 0)] * (masks.ndim - 2) + [(0, 1), (0, 1)], mode="edge")
    right, lower, diagonal = padded[..., :-1, 1:], padded[..., 1:, :-1], padded[..., 1:, 1:]
    return (masks != right) | (masks != lower) | (masks != diagonal)


def _masks(labels: Labels) -> Masks:
    ids = np.unique(labels[labels > 0])
    return labels[None] == ids[:, None, None]


def _products(a: Masks, b: Masks) -> NDArray[np.float64]:
    """Pixels that every mask of `a` shares with every mask of `b`."""
    flat_a, flat_b = (m.reshape(len(m), -1).astype(np.float32) for m in (a, b))
    return (flat_a @ flat_b.T).astype(np.float64)  # float32 counts exactly up to 2^24 pixels


def _boundary_matches(
    ours: Masks, theirs: Masks, pairs: tuple[NDArray[np.int64], NDArray[np.int64]], reach: int
) -> tuple[float, float]:
    """Border pixels near the border of the matched mask: predicted ones, true ones."""
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disk = x * x + y * y <= reach * reach
    hits = true_hits = 0.0
    for i, j in zip(*pairs, strict=True):
        predicted_border, true_border = borders(ours[i]), borders(theirs[j])
        hits += float((predicted_border & binary_dilation(true_border, disk)).sum())
        true_hits += float((true_border & binary_dilation(predicted_border, disk)).sum())
    return hits, true_hits


def _precision_recall_f(
    hits: float, predicted: float, true_hits: float, true: float
) -> tuple[float, float, float]:
    precision = hits / predicted if predicted else 0.0
    recall = true_hits / true if true else 0.0
    total = precision + recall
    return float(precision), float(recall), float(2 * precision * recall / total if total else 0.0)


def _without_pairs(predicted: int, true: int) -> MaskScores:
    precision, recall = float(predicted == 0), float(true == 0)
    f = precision * recall
    return MaskScores(precision, recall, f, precision, recall, f, f, predicted, true)
