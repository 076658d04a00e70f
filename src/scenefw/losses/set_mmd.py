"""Maximum mean discrepancy of drawn feature volumes from N(0, I) (thesis eq. 6.2)."""

from torch import Tensor

from scenefw.core.errors import InputError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup
from scenefw.core.settings import POSITIVE
from scenefw.losses.mmd import mmd_to_normal
from scenefw.losses.set_targets import require_given


class SetDiscrepancy:
    """Maximum mean discrepancy between feature volumes and N(0, I) (Zhao et al. 2017).

    Args:
        weight: factor of this term in the total; the thesis's is 1.
        bandwidth: variance of the kernel per dimension.
        per_cell: compare the vectors of single cells, many in a batch, in place of whole volumes.

    Raises:
        ConfigError: the bandwidth is not positive.
    """

    needs_draws = False

    def __init__(
        self, weight: float = 1.0, bandwidth: float = 1.0, *, per_cell: bool = False
    ) -> None:
        POSITIVE.require(bandwidth=bandwidth)
        self.weight, self.bandwidth, self.per_cell = weight, bandwidth, per_cell

    def check(self, setup: ObjectSetSetup) -> None:
        """Raises a ConfigError if the network draws nothing."""
        require_given("set_mmd", "latent", setup)

    def __call__(self, prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> Tensor:
        """A scalar.

        Raises:
            InputError: the network draws nothing.
        """
        latent = prediction.latent
        if latent is None:
            raise InputError("the network draws no feature volume; choose model=set_vae")
        vectors = latent.flatten(2).transpose(1, 2).flatten(0, 1) if self.per_cell else latent
        rows = vectors.flatten(1)
        return mmd_to_normal(rows, self.bandwidth * rows.shape[1])
