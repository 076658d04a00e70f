"""Loss of how much more the posterior says than the prior knows."""

from torch import Tensor

from scenefw.core.errors import InputError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup
from scenefw.losses.set_targets import require_given


class SetDivergence:
    """Kullback-Leibler divergence of the posterior from the prior, the mean over scenes.

    Args:
        weight: factor of this term in the total, whose other terms are means over voxels; as a sum
            over voxels they would be 10^5 times as large.
    """

    needs_draws = False

    def __init__(self, weight: float = 1e-6) -> None:
        self.weight = weight

    def check(self, setup: ObjectSetSetup) -> None:
        """Raises a ConfigError if the network has no prior that depends on the view."""
        require_given("set_divergence", "divergence", setup)

    def __call__(self, prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> Tensor:
        """A scalar in nats.

        Raises:
            InputError: the network gives no divergence.
        """
        if prediction.divergence is None:
            raise InputError("the network gives no divergence; choose model=set_placed_vae")
        return prediction.divergence.mean()
