"""Loss of the centre votes."""

from dataclasses import dataclass

from torch import Tensor

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.core.settings import POSITIVE, SHARE
from scenefw.losses.targets import require_target


@dataclass(eq=False)
class VoteLoss:
    """L2 norm of the difference of predicted and true centre votes (thesis eq. 5.14).

    Objects fill some 2 % of a grid, so that in the plain mean a network that votes for nothing at
    all does well for a long time; `object_share` gives the voxels of objects a share of the loss.

    Args:
        weight: factor of this term in the total.
        epsilon: added under the root (squared), so that the gradient of a perfect vote is finite.
        object_share: share of the loss that voxels of objects have together, free voxels the rest;
            None: every voxel counts the same, as in the thesis.
        target: name of the representation.

    Raises:
        ConfigError: epsilon is not positive, or the share is none.
    """

    needs_draws = False

    weight: float = 0.4
    epsilon: float = 1e-3
    object_share: float | None = None
    target: str = "votes"

    def __post_init__(self) -> None:
        POSITIVE.require(epsilon=self.epsilon)
        SHARE.require(object_share=self.object_share)

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError if the training has no such volume of vectors."""
        require_target("votes", self.target, setup, channels=3)

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar, the (weighted) mean over voxels."""
        truth = batch.targets[self.target].float()
        squared = (prediction.volumes[self.target].float() - truth).square().sum(dim=1)
        error = (squared + self.epsilon**2).sqrt() - self.epsilon
        if self.object_share is None:
            return error.mean()
        inside = (truth.square().sum(dim=1) > 0.5).to(error.dtype)  # votes are unit vectors, or 0
        return self.object_share * _mean(error, inside) + (1 - self.object_share) * _mean(
            error, 1 - inside
        )


def _mean(error: Tensor, weight: Tensor) -> Tensor:
    return (error * weight).sum() / weight.sum().clamp(min=1)
