"""Kullback-Leibler divergence of the posterior from N(0, I)."""

from torch import Tensor

from scenefw.core.errors import ConfigError
from scenefw.core.types import ShapeInstanceBatch, ShapeInstancePrediction


class KLDivergence:
    """Draws every posterior towards N(0, I) (Kingma and Welling 2014), the alternative to the MMD.

    Args:
        weight: factor of this term in the total. The evidence bound sums over voxels; beside means
            over voxels its weight of 1 becomes 1 / 64^3.
    """

    def __init__(self, weight: float = 4e-6) -> None:
        self.weight = weight

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar: the divergence in nats, the mean over the batch.

        Raises:
            ConfigError: the network gives no mean and log-variance.
        """
        if not {"mean", "log_variance"} <= prediction.statistics.keys():
            raise ConfigError(
                "the loss kl needs a network that gives mean and log_variance; leave it out"
            )
        mean = prediction.statistics["mean"].float()
        log_variance = prediction.statistics["log_variance"].float()
        terms = mean.square() + log_variance.exp() - 1 - log_variance
        return 0.5 * terms.sum(dim=1).mean()
