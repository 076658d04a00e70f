"""Reward for samples that differ; with `tsdf` an energy score."""

from torch import Tensor

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.core.errors import ConfigError
from scenefw.core.settings import POSITIVE
from scenefw.losses.targets import require_draws, require_target


class SampleSpread:
    """Minus half the distance of two samples of the same view, weighted as in the loss `tsdf`.

    Added to the error of one of the samples it makes the energy score of each voxel (Gneiting and
    Raftery 2007), E|v' - v| - E|v' - v''| / 2, which is least if samples are distributed as the
    truth is, given the view: where the view says all they agree, behind it they differ. `tsdf` on
    its own is least if all samples are the median.

    Args:
        weight: factor of this term in the total, that of `tsdf`. A larger one has no minimum.
        floor: smallest |v| in the weight, in truncations, that of `tsdf`.
        target: name of the representation.

    Raises:
        ConfigError: the floor is not positive.
    """

    needs_draws = True

    def __init__(self, weight: float = 1.0, floor: float = 0.1, target: str = "tsdf") -> None:
        POSITIVE.require(floor=floor)
        self.weight, self.floor, self.target = weight, floor, target

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError if there is no such volume, or no view with two codes."""
        require_target("sample_spread", self.target, setup)
        require_draws("sample_spread", setup)

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar of at most 0, the mean over voxels and over all rows of the batch.

        Raises:
            ConfigError: no view was predicted with two codes.
        """
        redrawn = prediction.redrawn
        if redrawn is None:
            raise ConfigError(
                "the loss sample_spread needs two codes per view; give model.prior_share of more "
                "than 0 and a batch large enough for it, or leave the loss out"
            )
        true = batch.targets[self.target]
        weight = 1 / true[redrawn.rows].float().abs().clamp(min=self.floor)
        first = prediction.volumes[self.target][redrawn.rows].float().clamp(-1, 1)
        second = redrawn.volumes[self.target].float().clamp(-1, 1)
        return -0.5 * (weight * (first - second).abs()).sum() / true.numel()
