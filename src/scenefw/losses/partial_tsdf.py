"""Loss of the conditioning autoencoder: the partial TSDF reconstructed from its code."""

from torch import Tensor

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.core.errors import ConfigError
from scenefw.core.settings import POSITIVE
from scenefw.losses.tsdf import weighted_distance_error


class PartialTsdfLoss:
    """Error of the reconstructed partial TSDF, weighted like the complete one (thesis eq. 5.15).

    Args:
        weight: factor of this term in the total.
        floor: smallest |v| in the weight, in truncations.
        one_sided: don't punish distances beyond the truncation where the truth is cut there.

    Raises:
        ConfigError: the floor is not positive.
    """

    needs_draws = False

    def __init__(self, weight: float = 0.3, floor: float = 0.1, *, one_sided: bool = True) -> None:
        POSITIVE.require(floor=floor)
        self.weight, self.floor, self.one_sided = weight, floor, one_sided

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Fits any volumes."""

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar, the mean over voxels.

        Raises:
            ConfigError: the network doesn't rebuild its condition.
        """
        if prediction.partial is None:
            raise ConfigError(
                "the loss partial_tsdf needs a network that rebuilds its condition; leave it out"
            )
        truth = batch.condition[:, :1]
        return weighted_distance_error(
            prediction.partial, truth, self.floor, one_sided=self.one_sided
        )
