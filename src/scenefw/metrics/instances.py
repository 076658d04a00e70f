"""How well instances fit the true objects, whatever their numbering."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenefw.core.protocols import Matching
from scenefw.matching.assignment import Assignment
from scenefw.matching.costs import iou_matrix, overlaps

Float64 = NDArray[np.float64]


class InstanceScores(NamedTuple):
    """Scores of one labelling.

    Args:
        iou: mean over true objects of the IoU with the matched instance, 0 where none is left.
        panoptic_quality: sum of IoUs above 1/2 over (matched + half of the unmatched of both).
        recall: share of true objects matched with an IoU above 1/2.
        count_error: |instances - true objects|.
        excess: instances - true objects.
    """

    iou: float
    panoptic_quality: float
    recall: float
    count_error: float
    excess: float


def instance_scores(
    predicted: NDArray[np.integer], true: NDArray[np.integer], matching: Matching | None = None
) -> InstanceScores:
    """Scores after one-to-one matching by largest total IoU.

    Args:
        predicted: labels, 0 = no object.
        true: labels of the same shape.
        matching: default is the optimal assignment.
    """
    return scores_of(iou_matrix(predicted, true), matching)


def scores_of(iou: Float64, matching: Matching | None = None) -> InstanceScores:
    """Scores of an IoU matrix (P, T) of predicted and true objects."""
    pairs = (matching or Assignment()).assign(-iou)
    matched = iou[pairs[:, 0], pairs[:, 1]]
    return InstanceScores(
        mean_iou(matched, iou.shape[1]),
        panoptic_quality(iou),
        float((matched > 0.5).sum() / iou.shape[1]) if iou.shape[1] else 1.0,
        float(abs(iou.shape[0] - iou.shape[1])),
        float(iou.shape[0] - iou.shape[1]),
    )


def object_ious(
    predicted: NDArray[np.integer], true: NDArray[np.integer], matching: Matching | None = None
) -> dict[int, float]:
    """IoU of each true object, by its label, with the instance matched to it; 0 where none is.

    Args:
        predicted: labels, 0 = no object.
        true: labels of the same shape.
        matching: default is the optimal assignment.
    """
    overlap = overlaps(predicted, true)
    ious = dict.fromkeys(overlap.true.tolist(), 0.0)
    for row, column in (matching or Assignment()).assign(-overlap.iou):
        ious[int(overlap.true[column])] = float(overlap.iou[row, column])
    return ious


def mean_iou(matched: Float64, objects: int) -> float:
    """Mean IoU over true objects; those without a partner count 0; 1 if there are none."""
    return float(matched.sum() / objects) if objects else 1.0


def panoptic_quality(iou: Float64) -> float:
    """Panoptic quality (Kirillov et al. 2019) of an IoU matrix; pairs above 1/2 are unique."""
    matched_ious = iou[iou > 0.5]
    unmatched = iou.shape[0] + iou.shape[1] - 2 * len(matched_ious)
    total = len(matched_ious) + 0.5 * unmatched
    return float(matched_ious.sum() / total) if total else 1.0
