"""The view rebuilt by a network of sets (thesis eq. 6.2)."""

from torch import Tensor

from scenefw.core.errors import InputError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup
from scenefw.losses.set_targets import require_given


class SetPartial:
    """Mean absolute error of the reconstructed partial TSDF, in truncations.

    Args:
        weight: factor of this term in the total; the thesis's is 1.
    """

    needs_draws = False

    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def check(self, setup: ObjectSetSetup) -> None:
        """Raises a ConfigError if the network doesn't rebuild its condition."""
        require_given("set_partial", "partial", setup)

    def __call__(self, prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> Tensor:
        """A scalar, the mean over voxels.

        Raises:
            InputError: the network doesn't rebuild its condition.
        """
        if prediction.partial is None:
            raise InputError("the network doesn't rebuild its view; choose model=set_vae")
        return (prediction.partial.float() - batch.condition[:, :1]).abs().mean()
