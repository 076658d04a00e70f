"""Agreement of two measurements of the same thing when neither is the truth."""

import numpy as np
from numpy.typing import NDArray

from scenefw.metrics.semantic import class_ious, count_classes

Labels = NDArray[np.integer]
Array = NDArray[np.floating]


def agreement(first: Labels, second: Labels) -> float:
    """Share of places with the same label, of those that both label (0 or above); NaN if none."""
    labelled = (first >= 0) & (second >= 0)
    return float(np.mean(first[labelled] == second[labelled])) if labelled.any() else float("nan")


def chance_agreement(first: Labels, second: Labels, classes: int) -> float:
    """Agreement if both drew labels independently, each with its own shares (Cohen 1960).

    Args:
        first: class ids, below 0 where unlabelled.
        second: of the same shape.
        classes: their number.
    """
    labelled = (first >= 0) & (second >= 0)
    if not labelled.any():
        return float("nan")
    shares = [
        np.bincount(labels[labelled], minlength=classes) / labelled.sum()
        for labels in (first, second)
    ]
    return float(shares[0] @ shares[1])


def mutual_iou(first: Labels, second: Labels, classes: int) -> float:
    """Mean IoU over the classes that either holds; it is the same if they change places.

    Args:
        first: class ids, below 0 where unlabelled.
        second: of the same shape.
        classes: their number.
    """
    labelled = (first >= 0) & (second >= 0)
    pair = first[labelled], second[labelled]
    counts, swapped_counts = count_classes(*pair, classes), count_classes(*pair[::-1], classes)
    # NaN where only the other holds a class
    ious = np.fmax(class_ious(counts), class_ious(swapped_counts))
    return float(np.nanmean(ious)) if np.isfinite(ious).any() else float("nan")


def plane_through(places: Array, heights: Array) -> tuple[float, float]:
    """Tilt (degrees) and roughness (m) of a nearly level surface.

    A plane is fitted by least squares, twice, the second time to what lies within three
    deviations of the first. Roughness is the deviation from it, by the median (MAD x 1.4826), so
    that a few vertices of objects don't count.

    Args:
        places: (N, 2) x and y (m), N >= 3.
        heights: (N,) metres.
    """
    terms = np.column_stack([places - places.mean(axis=0), np.ones(len(places))]).astype(np.float64)
    inliers = np.ones(len(heights), dtype=bool)
    for _ in range(2):
        slope = np.linalg.lstsq(terms[inliers], heights[inliers], rcond=None)[0]
        residuals = np.abs(heights - terms @ slope)
        roughness = 1.4826 * float(np.median(residuals[inliers]))
        inliers = residuals <= max(3 * roughness, 1e-9)
    return float(np.degrees(np.arctan(np.hypot(*slope[:2])))), roughness
