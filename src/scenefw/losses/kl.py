"""Kullback-Leibler divergence of the posterior from N(0, I)."""

from torch import Tensor

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.core.errors import ConfigError
from scenefw.core.settings import NOT_NEGATIVE


class KLDivergence:
    """Pulls every posterior towards N(0, I) (Kingma and Welling 2014), the alternative to the MMD.

    A network that knows the view well can do without its code, and a penalty from the first step on
    teaches it to. `free` nats cost nothing, so that a code of about that much information stays in
    use (Kingma et al. 2016).

    Args:
        weight: factor of this term in the total. The evidence bound sums over voxels; beside means
            over voxels its weight of 1 becomes 1 / 64^3.
        free: divergence in nats below which nothing is lost, a mean over the batch.

    Raises:
        ConfigError: free is negative.
    """

    needs_draws = False

    def __init__(self, weight: float = 4e-6, free: float = 0.0) -> None:
        NOT_NEGATIVE.require(free=free)
        self.weight, self.free = weight, free

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Fits any volumes."""

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar: the divergence in nats, the mean over the batch, at least `free`.

        Raises:
            ConfigError: the network gives no mean and log-variance.
        """
        if not {"mean", "log_variance"} <= prediction.statistics.keys():
            raise ConfigError(
                "the loss kl needs mean and log_variance from an encoder; give model.prior_share a "
                "lower value, or leave it out"
            )
        mean = prediction.statistics["mean"].float()
        log_variance = prediction.statistics["log_variance"].float()
        terms = mean.square() + log_variance.exp() - 1 - log_variance
        return (0.5 * terms.sum(dim=1).mean()).clamp(min=self.free)
