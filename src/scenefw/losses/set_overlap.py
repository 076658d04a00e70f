"""Loss of the overlap of predicted objects with those they are matched to."""

import torch
from torch import Tensor

from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup
from scenefw.losses.set_targets import matched_of, object_sums

_VOXELS = 1.0  # added to both sums, so that an object of no voxel is no division by 0


class SetOverlap:
    """One minus the soft Dice coefficient of matched predictions (Milletari et al. 2016).

    An object fills a hundredth of the grid or less, so the cross entropy is small as soon as a
    prediction is empty. Here it is 1, however small the object.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False

    def __init__(self, weight: float = 1e-2) -> None:
        self.weight = weight

    def check(self, setup: ObjectSetSetup) -> None:
        """Fits any set."""

    def __call__(self, prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> Tensor:
        """A scalar, the mean over predictions that stand for an object.

        Raises:
            InputError: predictions are not matched.
        """
        objects = matched_of(prediction)
        is_matched = objects >= 0
        shares = prediction.logits.float().sigmoid()
        common, true = object_sums(shares, objects, batch)
        totals = shares.sum(dim=(2, 3, 4)) + true
        missed = 1 - (2 * common + _VOXELS) / (totals + _VOXELS)
        return torch.where(is_matched, missed, 0.0).sum() / is_matched.sum().clamp_min(1)
