"""How well a set of occupied volumes decomposes a scene into its objects (thesis chapter 6)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.protocols import Matching
from scenefw.matching.assignment import Assignment
from scenefw.matching.costs import Overlaps
from scenefw.metrics.instances import mean_iou

Bool = NDArray[np.bool_]

FOUND, COVERED, KEPT = 0.25, 0.5, 0.5
"""IoU at which an object is found; share of it that is covered; IoU at which it is not split."""


class DecompositionScores(NamedTuple):
    """What is wrong with one set. The thesis counts scenes with errors, and doesn't define them.

    Args:
        object_iou: mean over true objects of the IoU with the matched prediction, 0 without one.
        missing: true objects with no prediction of an IoU of 0.25 or more.
        joined: predictions that cover half or more of each of two or more true objects.
        duplicate: further predictions with an IoU of 0.25 or more with a matched true object.
        split: true objects in which two or more predictions lie, half or more of each, and none of
            which has an IoU of 0.5 or more.
        excess: predictions - true objects.
    """

    object_iou: float
    missing: int
    joined: int
    duplicate: int
    split: int
    excess: int


def set_overlaps(predicted: Bool, true: Bool) -> Overlaps:
    """What objects share, as volumes that may overlap.

    Args:
        predicted: (P, ...) bool, a volume per object.
        true: (T, ...) bool on the same voxels.

    Raises:
        InputError: volumes are not of the same voxels.
    """
    if predicted.shape[1:] != true.shape[1:]:
        raise InputError(
            f"predicted objects have {predicted.shape[1:]} voxels and true ones {true.shape[1:]}; "
            "compare them on one grid"
        )
    voxels = int(np.prod(true.shape[1:]))  # also of no object
    rows, columns = predicted.reshape(-1, voxels), true.reshape(-1, voxels)
    occupied = columns.any(axis=0) | rows.any(axis=0)
    rows, columns = rows[:, occupied], columns[:, occupied]
    shared = rows.astype(np.float32) @ columns.astype(np.float32).T
    return Overlaps(
        np.arange(1, len(rows) + 1),
        np.arange(1, len(columns) + 1),
        np.rint(shared).astype(np.int64),
        rows.sum(axis=1),
        columns.sum(axis=1),
    )


def found_objects(predicted: Bool, true: Bool) -> Bool:
    """Which true objects (T,) have a prediction with an IoU of 0.25 or more.

    Args:
        predicted: (P, X, Y, Z), each with a voxel at least.
        true: (T, X, Y, Z), the same.

    Raises:
        InputError: volumes are not of the same voxels.
    """
    return np.asarray((set_overlaps(predicted, true).iou >= FOUND).any(axis=0))


def decomposition_scores(
    predicted: Bool, true: Bool, matching: Matching | None = None
) -> DecompositionScores:
    """Scores of one scene.

    Args:
        predicted: (P, X, Y, Z), each with a voxel at least.
        true: (T, X, Y, Z), the same.
        matching: by largest total IoU; default is the optimal assignment.

    Raises:
        InputError: volumes are not of the same voxels.
    """
    overlaps = set_overlaps(predicted, true)
    iou = overlaps.iou
    pairs = (matching or Assignment()).assign(-iou)
    rows, columns = pairs[:, 0], pairs[:, 1]
    matched = iou[rows, columns]
    hits = iou >= FOUND
    second = hits.copy()
    second[rows, columns] = False
    has_partner = np.isin(np.arange(iou.shape[1]), columns[matched > 0])
    covers = overlaps.shared >= COVERED * overlaps.true_sizes
    within = overlaps.shared >= COVERED * overlaps.predicted_sizes[:, None]
    is_intact = (iou >= KEPT).any(axis=0)
    return DecompositionScores(
        mean_iou(matched, iou.shape[1]),
        int((~hits.any(axis=0)).sum()),
        int((covers.sum(axis=1) >= 2).sum()),
        int((second & has_partner).any(axis=1).sum()),
        int(((within.sum(axis=0) >= 2) & ~is_intact).sum()),
        iou.shape[0] - iou.shape[1],
    )
