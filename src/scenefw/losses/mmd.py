"""Maximum mean discrepancy between the codes of a batch and N(0, I)."""

import torch
from torch import Tensor

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.core.errors import ConfigError
from scenefw.core.settings import POSITIVE


def mmd_to_normal(codes: Tensor, variance: float) -> Tensor:
    """Squared MMD of codes (B, L) and N(0, I) for the kernel exp(-|x - y|^2 / (2 variance)).

    The expectations over the normal distribution are taken in closed form, not from samples. The
    mean over pairs of codes leaves out each code with itself if B > 1, so the estimate is unbiased
    and may be slightly negative.
    """
    codes = codes.float()
    count, size = codes.shape
    distances = (codes[:, None] - codes[None]).square().sum(dim=-1)
    pairs = (-distances / (2 * variance)).exp()
    if count > 1:
        diagonal = torch.eye(count, dtype=torch.bool, device=codes.device)
        within = pairs.masked_fill(diagonal, 0.0).sum() / (count * (count - 1))
    else:
        within = pairs.mean()
    spread = (variance / (variance + 1)) ** (size / 2)
    across = (spread * (-codes.square().sum(dim=-1) / (2 * (variance + 1))).exp()).mean()
    prior = (variance / (variance + 2)) ** (size / 2)
    return within - 2 * across + prior


class MaximumMeanDiscrepancy:
    """Pulls the distribution of codes towards N(0, I) with an RBF kernel (Zhao et al. 2017).

    The thesis weighs it by 1e5 beside losses summed over 64^3 voxels. Beside means over voxels
    that is 1e5 / 64^3 = 0.38, whatever the resolution.

    Args:
        weight: factor of this term in the total.
        bandwidth: variance of the kernel per dimension of the code; at 1 two independent draws
            from N(0, I) have a kernel value near 1 / e.
    """

    needs_draws = False

    def __init__(self, weight: float = 0.38, bandwidth: float = 1.0) -> None:
        POSITIVE.require(bandwidth=bandwidth)
        self.weight, self.bandwidth = weight, bandwidth

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Fits any volumes."""

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar.

        Raises:
            ConfigError: no code of the batch comes from an encoder.
        """
        if prediction.latent is None:
            raise ConfigError(
                "the loss mmd needs codes from an encoder; give model.prior_share a lower value, "
                "or leave it out"
            )
        size = prediction.latent.shape[1]
        return mmd_to_normal(prediction.latent, self.bandwidth * size)
