"""How well the lines between objects are found: borders where two instances meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from scenefw_single_view_benchmarks.mask_scores import radius, require_one_size

Labels = NDArray[np.integer]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Seams:
    """Pixels on the seams of one image, or of several if added up.

    Args:
        hits: predicted ones near a true one.
        predicted: predicted ones, where the truth is known.
        true_hits: true ones near a predicted one.
        true: true ones.
    """

    hits: int = 0
    predicted: int = 0
    true_hits: int = 0
    true: int = 0

    def __add__(self, other: Seams) -> Seams:
        """The pixels of both."""
        return Seams(
            self.hits + other.hits,
            self.predicted + other.predicted,
            self.true_hits + other.true_hits,
            self.true + other.true,
        )

    @property
    def seam_precision(self) -> float:
        """Share of the predicted seams that are true; 1 if nothing is predicted."""
        return self.hits / self.predicted if self.predicted else 1.0

    @property
    def seam_recall(self) -> float:
        """Share of the true seams that are found; 1 if there is none."""
        return self.true_hits / self.true if self.true else 1.0

    @property
    def seam_f(self) -> float:
        """Harmonic mean of precision and recall."""
        total = self.seam_precision + self.seam_recall
        return 2 * self.seam_precision * self.seam_recall / total if total else 0.0


def seam_scores(predicted: Labels, true: Labels, tolerance: float = 0.003) -> Seams:
    """Compares the seams of predicted instances with the true ones.

    Which object is which does not matter, only where one ends and another begins. Borders with the
    floor are no seams, so what counts as floor hardly matters either.

    Args:
        predicted: (H, W) labels, <= 0 where no object.
        true: (H, W) labels, 0 = no object, -1 = unknown: predicted seams there count for nothing.
        tolerance: two objects meet, and seams match, within ceil(tolerance * image diagonal)
            pixels.

    Raises:
        InputError: the two images differ in size.
    """
    require_one_size(predicted, true)
    reach = radius(true, tolerance)
    ours, theirs = seams(predicted, reach), seams(true, reach)
    predicted_seams = ours & (true >= 0)
    return Seams(
        hits=int((predicted_seams & _dilate(theirs, reach)).sum()),
        predicted=int(predicted_seams.sum()),
        true_hits=int((theirs & _dilate(ours, reach)).sum()),
        true=int(theirs.sum()),
    )


def seams(labels: Labels, reach: int) -> Mask:
    """Pixels (H, W) where an object meets another.

    These are the pixels of an object that touch something else with a side and have a pixel of
    another object within `reach`. So a seam has a line of pixels on each of its sides.
    """
    seam_mask = np.zeros(labels.shape, bool)
    inner = _touching(labels)
    for i in np.unique(labels[labels > 0]):
        object_mask = labels == i
        seam_mask |= object_mask & inner & _dilate((labels > 0) & ~object_mask, reach)
    return seam_mask


def _touching(labels: Labels) -> Mask:
    """Pixels with a neighbour above, below, left or right of another label."""
    border_mask = np.zeros(labels.shape, bool)
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        differ = labels[a] != labels[b]
        border_mask[a] |= differ
        border_mask[b] |= differ
    return border_mask


def _dilate(mask: Mask, reach: int) -> Mask:
    """Pixels at most `reach` from the mask."""
    if not mask.any():
        return mask
    dilated: Mask = distance_transform_edt(~mask) <= reach
    return dilated
