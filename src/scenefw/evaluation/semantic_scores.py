"""Intersection over union of semantic labels, from counts of true against predicted classes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError

Counts = NDArray[np.int64]
Labels = NDArray[np.integer]


def count_classes(
    predicted: Labels, true: Labels, classes: int, where: NDArray[np.bool_] | None = None
) -> Counts:
    """Pixels or vertices (C, C + 1) of each true class (row) by predicted class (column).

    The last column counts what has no label (below 0): true ones that were missed. What has no
    true label is left out.

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
    chosen = true >= 0 if where is None else (true >= 0) & where
    rows, columns = true[chosen].astype(np.int64), predicted[chosen].astype(np.int64)
    largest = max(rows.max(initial=0), columns.max(initial=0))
    if largest >= classes:
        raise InputError(f"class id {largest} among labels of {classes} classes; check the classes")
    columns = np.where(columns < 0, classes, columns)
    flat = np.bincount(rows * (classes + 1) + columns, minlength=classes * (classes + 1))
    return flat.reshape(classes, classes + 1)


def class_ious(counts: Counts) -> NDArray[np.float64]:
    """Intersection over union (C,) of each class; NaN for those that the truth does not hold."""
    square = counts[:, : len(counts)]
    hits = square.diagonal().astype(np.float64)
    true, predicted = counts.sum(axis=1), square.sum(axis=0)
    union = true + predicted - hits
    return np.where(true > 0, hits / np.maximum(union, 1), np.nan)


def mean_iou(counts: Counts) -> float:
    """Mean over the classes that the truth holds, each counting the same."""
    ious = class_ious(counts)
    held = ious[np.isfinite(ious)]
    return float(held.mean()) if len(held) else float("nan")


def weighted_iou(counts: Counts) -> float:
    """Mean over classes weighted by how much of the truth they are, so mostly the surface's."""
    true = counts.sum(axis=1)
    if not true.sum():
        return float("nan")
    return float(np.nansum(class_ious(counts) * true) / true.sum())
