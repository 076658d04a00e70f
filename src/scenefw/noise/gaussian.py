"""Independent Gaussian noise on every measured depth."""

import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch
from scenefw.core.settings import NOT_NEGATIVE, SHARE, between
from scenefw.kernels.cameras import finite
from scenefw.kernels.compile import float32
from scenefw.kernels.depth_noise import add_noise


class Gaussian:
    """Adds white noise of the same standard deviation to every measured pixel of an image.

    Args:
        sigma: standard deviation of z-depth (m).
        lowest: if given, each image has its own, drawn evenly from this to sigma, so that a network
            trains on all of them.
        share: share of the images that are disturbed; the others pass as they are.

    Raises:
        ConfigError: not 0 <= lowest <= sigma, or a share that is none.
    """

    def __init__(
        self, sigma: float = 0.002, lowest: float | None = None, share: float = 1.0
    ) -> None:
        NOT_NEGATIVE.require(sigma=sigma)
        between(0, sigma).require(lowest=lowest)
        SHARE.require(share=share)
        self.sigma = sigma
        self.lowest = sigma if lowest is None else lowest
        self.share = share

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 and what is not finite become 0.

        The rest stays positive.
        """
        depth = finite(depth.float(), 0.0).contiguous()
        noisy = torch.empty_like(depth)
        pixels = depth.shape[1] * depth.shape[2]
        flat = (depth.view(-1), seeds, noisy.view(-1))
        add_noise(depth.numel(), *flat, pixels, *float32(self.lowest, self.sigma, self.share))
        return noisy
