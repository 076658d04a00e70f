"""How much two labellings of the same voxels or pixels overlap."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError

Labels = NDArray[np.integer]


class Overlaps(NamedTuple):
    """Instances of two labellings and what they share.

    Args:
        predicted: (P,) labels of the first, ascending, without 0.
        true: (T,) labels of the second.
        shared: (P, T) voxels in both.
        predicted_sizes: (P,) voxels.
        true_sizes: (T,) voxels.
    """

    predicted: NDArray[np.int64]
    true: NDArray[np.int64]
    shared: NDArray[np.int64]
    predicted_sizes: NDArray[np.int64]
    true_sizes: NDArray[np.int64]

    @property
    def iou(self) -> NDArray[np.float64]:
        """Intersection over union of every pair, (P, T)."""
        union = self.predicted_sizes[:, None] + self.true_sizes[None] - self.shared
        return self.shared / np.maximum(union, 1)


def overlaps(predicted: Labels, true: Labels) -> Overlaps:
    """Counts what instances share, in one pass whatever their number.

    Args:
        predicted: labels >= 0, 0 = no object, numbered in any way.
        true: the same of another labelling of the same shape.

    Raises:
        InputError: shapes differ or a label is negative.
    """
    predicted, true = np.asarray(predicted), np.asarray(true)
    if predicted.shape != true.shape:
        raise InputError(
            f"predicted labels have shape {predicted.shape} and true labels {true.shape}; expected "
            "two labellings of the same voxels"
        )
    if predicted.size and min(predicted.min(), true.min()) < 0:
        raise InputError("labels must be >= 0, 0 = no object; set unknown voxels to 0 in both")
    rows, row_ids = _ranked(predicted)
    columns, column_ids = _ranked(true)
    width = len(column_ids)
    counts = np.bincount(rows * width + columns, minlength=len(row_ids) * width)
    table = counts.reshape(len(row_ids), width)
    return Overlaps(
        row_ids[1:], column_ids[1:], table[1:, 1:], table[1:].sum(axis=1), table[:, 1:].sum(axis=0)
    )


def iou_matrix(predicted: Labels, true: Labels) -> NDArray[np.float64]:
    """Intersection over union (P, T) of instances in the order of their labels."""
    return overlaps(predicted, true).iou


def _ranked(labels: Labels) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Flat ranks of the labels and the label of each rank; rank 0 is label 0, there or not."""
    flat = labels.ravel().astype(np.int64)
    present = np.bincount(flat, minlength=1) > 0
    present[0] = True
    ranks = np.cumsum(present) - 1
    return ranks[flat], np.flatnonzero(present)
