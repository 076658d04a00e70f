"""The loss: the logarithmic score of a predicted distribution."""

from torch import Tensor
from torch.nn.functional import cross_entropy

from scenefw_object_count.batches import CountBatch, CountSetup


class LogScore:
    """Mean of -log p(true number) in nats, least for the true distribution (Good 1952).

    Args:
        weight: in the sum of losses.
    """

    needs_draws = False

    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def check(self, setup: CountSetup) -> None:
        """Fits any number of objects."""

    def __call__(self, prediction: Tensor, batch: CountBatch) -> Tensor:
        """Of scores (B, most)."""
        return cross_entropy(prediction.float(), batch.counts - 1)
