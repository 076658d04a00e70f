"""Intersection over union of semantic labels over a whole data set.

Counts of images are added up before anything is divided, so that an image without an object does
not weigh on its class. The headline is the mean over classes of these data-set IoUs; the mean that
is weighted by how often a class occurs is mostly the surface's.
"""

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError

Counts = NDArray[np.int64]
Labels = NDArray[np.integer]


def count_classes(
    predicted: Labels, true: Labels, classes: int, where: NDArray[np.bool_] | None = None
) -> Counts:
    """Confusion counts (C, C + 1): true class by predicted class.

    The last column counts what was given no label (below 0): true ones that were missed. What has
    no true label (below 0) is left out.

    Args:
        predicted: class ids of any shape.
        true: class ids of that shape.
        classes: their number C.
        where: what counts, of that shape; None = all.

    Raises:
        InputError: the shapes differ, or there are ids that no class has.
    """
    if predicted.shape != true.shape:
        raise InputError(
            f"labels have shape {predicted.shape}, the truth {true.shape}; give both on one grid"
        )
    valid = true >= 0 if where is None else (true >= 0) & where
    rows, columns = true[valid].astype(np.int64), predicted[valid].astype(np.int64)
    largest = max(rows.max(initial=0), columns.max(initial=0))
    if largest >= classes:
        raise InputError(f"class id {largest} among labels of {classes} classes; check the classes")
    columns = np.where(columns < 0, classes, columns)
    flat = np.bincount(rows * (classes + 1) + columns, minlength=classes * (classes + 1))
    return flat.reshape(classes, classes + 1)


def class_ious(counts: Counts) -> NDArray[np.float64]:
    """IoU (C,) of each class; NaN for those that the truth does not hold."""
    square = counts[:, : len(counts)]
    hits = square.diagonal().astype(np.float64)
    true, predicted = counts.sum(axis=1), square.sum(axis=0)
    return np.where(true > 0, hits / np.maximum(true + predicted - hits, 1), np.nan)


def mean_iou(counts: Counts) -> float:
    """Mean over the classes that the truth holds, each counting the same; NaN if there is none."""
    ious = class_ious(counts)
    return float(np.nanmean(ious)) if np.isfinite(ious).any() else float("nan")


def weighted_iou(counts: Counts) -> float:
    """Mean over classes weighted by how much of the truth they are; NaN if there is none."""
    true = counts.sum(axis=1)
    if not true.sum():
        return float("nan")
    return float(np.nansum(class_ious(counts) * true) / true.sum())
