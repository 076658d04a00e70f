"""Which of the objects that a network of sets predicts are there, and whose each voxel is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.metrics.decomposition import set_overlaps

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.object_sets import ObjectSetPrediction
    from scenefw.core.types import GridSpec


@dataclass(frozen=True)
class ChosenObjects:
    """The objects of one scene.

    Args:
        inside: (N, X, Y, Z) bool, voxels of each prediction; they may overlap.
        exists: (N,) bool, which predictions are objects.
        labels: (X, Y, Z) int64: of those, counted from 1, the most probable one; 0 = none.
    """

    inside: NDArray[np.bool_]
    exists: NDArray[np.bool_]
    labels: NDArray[np.int64]


def chosen_objects(
    prediction: ObjectSetPrediction,
    row: int,
    grid: GridSpec,
    smallest: float,
    suppress: float | None,
) -> ChosenObjects:
    """Objects of a scene of a batch.

    Args:
        prediction: of the batch.
        row: of the scene.
        grid: of the volumes.
        smallest: a prediction of a lower volume above 1/2 is no object (m^3).
        suppress: of predictions that overlap with this IoU or more the surest stays, the one with
            the highest existence score, or without such scores the largest; None: all stay.
    """
    logits = prediction.logits[row].float().cpu()
    inside = (logits > 0).numpy()
    volumes = inside.sum(axis=(1, 2, 3))
    exists = volumes >= max(math.ceil(smallest / grid.voxel_size**3), 1)
    scores = volumes.astype(np.float64)
    if prediction.existence is not None:
        scores = prediction.existence[row].double().cpu().numpy()
        exists &= scores > 0
    if suppress is not None:
        exists = kept(inside, exists, scores, suppress)
    return ChosenObjects(inside, exists, _labels(logits[torch.from_numpy(np.flatnonzero(exists))]))


def kept(
    inside: NDArray[np.bool_],
    exists: NDArray[np.bool_],
    scores: NDArray[np.float64],
    max_iou: float,
) -> NDArray[np.bool_]:
    """Which predictions stay if of those that overlap only the one with the highest score may.

    Args:
        inside: (N, X, Y, Z) voxels of each.
        exists: (N,) which are looked at.
        scores: (N,) how sure each is.
        max_iou: IoU from which on a prediction is another one's duplicate.
    """
    iou = set_overlaps(inside, inside).iou
    keep_mask = np.zeros_like(exists)
    for i in np.argsort(-scores, kind="stable"):
        keep_mask[i] = exists[i] and not (iou[i, keep_mask] >= max_iou).any()
    return keep_mask


def _labels(logits: Tensor) -> NDArray[np.int64]:
    """Of objects (P, X, Y, Z): the most probable one, 1..P, 0 where none is above 1/2."""
    if not len(logits):
        return np.zeros(logits.shape[1:], np.int64)
    highest, index = logits.max(dim=0)
    return torch.where(highest > 0, index + 1, 0).numpy()
