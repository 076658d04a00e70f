"""Independent Gaussian noise on every measured depth."""

import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch
from scenefw.core.errors import ConfigError
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
        if not sigma >= 0:
            raise ConfigError(
                f"Gaussian noise has sigma = {sigma}; expected metres, 0 or more (0.002 is 2 mm)"
            )
        self.sigma = sigma
        self.lowest = sigma if lowest is None else lowest
        if not 0 <= self.lowest <= sigma:
            raise ConfigError(
                f"Gaussian noise has lowest = {lowest}, sigma = {sigma}; expected lowest between 0 "
                "and sigma (m)"
            )
        if not 0 <= share <= 1:
            raise ConfigError(
                f"Gaussian noise has share = {share}; expected a share of the images, 0 to 1"
            )
        self.share = share

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 and what is not finite become 0.

        The rest stays positive.

        Args:
            depth: (B, H, W) metres.
            cameras: unused; white noise looks alike through every lens.
            seeds: (B,) int64, 0 or more: one per image, on the same device.
        """
        depth = finite(depth.float(), 0.0).contiguous()
        noisy = torch.empty_like(depth)
        pixels = depth.shape[1] * depth.shape[2]
        flat = (depth.view(-1), seeds, noisy.view(-1))
        add_noise(depth.numel(), *flat, pixels, *float32(self.lowest, self.sigma, self.share))
        return noisy
