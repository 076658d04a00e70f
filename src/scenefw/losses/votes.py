"""Loss of the centre votes."""

from torch import Tensor

from scenefw.core.types import ShapeInstanceBatch, ShapeInstancePrediction


class VoteLoss:
    """L2 norm of the difference of predicted and true centre votes (thesis eq. 5.14).

    Args:
        weight: factor of this term in the total.
        epsilon: added under the root (squared), so that the gradient of a perfect vote is finite.
    """

    def __init__(self, weight: float = 1.0, epsilon: float = 1e-3) -> None:
        self.weight, self.epsilon = weight, epsilon

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar, the mean over voxels."""
        squared = (prediction.votes.float() - batch.votes.float()).square().sum(dim=1)
        return ((squared + self.epsilon**2).sqrt() - self.epsilon).mean()
