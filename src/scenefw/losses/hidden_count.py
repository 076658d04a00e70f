"""Loss of the number of objects that a view doesn't show."""

from torch import Tensor
from torch.nn import functional

from scenefw.core.batches import SeenSetBatch, SetFlowPrediction, SetFlowSetup


class HiddenCount:
    """Cross entropy (nats) of the number of objects of which nothing is seen.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False

    def __init__(self, weight: float = 0.3) -> None:
        self.weight = weight

    def check(self, setup: SetFlowSetup) -> None:
        """Any flow of sets has such a number."""

    def __call__(self, prediction: SetFlowPrediction, batch: SeenSetBatch) -> Tensor:
        """A scalar, the mean over views."""
        return functional.cross_entropy(prediction.counts.float(), prediction.hidden)
