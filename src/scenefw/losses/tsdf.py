"""Signed-distance loss with more weight near the surface."""

from dataclasses import KW_ONLY, dataclass

import torch
from torch import Tensor

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.core.settings import POSITIVE
from scenefw.losses.targets import require_target


def weighted_distance_error(
    predicted: Tensor, truth: Tensor, floor: float, *, one_sided: bool
) -> Tensor:
    """Mean over voxels of |v - v'| / max(|v|, floor) (eq. 5.13), distances in units of truncation.

    Args:
        predicted: v', any shape.
        truth: v, in [-1, 1].
        floor: bounds the weight, which eq. 5.13 leaves at up to 1e9.
        one_sided: a predicted distance beyond +-1 is right where the truth is cut at +-1.
    """
    predicted, truth = predicted.float(), truth.float()
    if one_sided:
        predicted = torch.where(truth >= 1, predicted.clamp(max=1), predicted)
        predicted = torch.where(truth <= -1, predicted.clamp(min=-1), predicted)
    weight = 1 / truth.abs().clamp(min=floor)
    return (weight * (predicted - truth).abs()).mean()


@dataclass(eq=False)
class TsdfLoss:
    """Error of the complete TSDF, weighted by 1 / (|v| + eps) (thesis eq. 5.13).

    The thesis's eps of 1e-9 makes the weight at surface voxels unbounded; here 1 / |v| is floored.

    Args:
        weight: factor of this term in the total.
        floor: smallest |v| in the weight, in truncations: 0.1 of 5 voxels is half a voxel, so no
            voxel counts more than 10 times one in free space.
        target: name of the representation.
        one_sided: don't punish distances beyond the truncation where the truth is cut there.

    Raises:
        ConfigError: the floor is not positive.
    """

    needs_draws = False

    weight: float = 1.0
    floor: float = 0.1
    target: str = "tsdf"
    _: KW_ONLY
    one_sided: bool = True

    def __post_init__(self) -> None:
        POSITIVE.require(floor=self.floor)

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError if the training has no such volume."""
        require_target("tsdf", self.target, setup)

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar, the mean over voxels."""
        predicted, true = prediction.volumes[self.target], batch.targets[self.target]
        return weighted_distance_error(predicted, true, self.floor, one_sided=self.one_sided)
