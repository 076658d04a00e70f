"""Independent Gaussian noise on every measured depth."""

import torch
from torch import Tensor

from scenefw.core.errors import ConfigError
from scenefw.core.types import CameraBatch


class Gaussian:
    """Adds white noise of constant standard deviation to every measured pixel.

    Args:
        sigma: standard deviation of z-depth (m).
    """

    def __init__(self, sigma: float = 0.002) -> None:
        if not sigma >= 0:
            raise ConfigError(
                f"Gaussian noise has sigma = {sigma}; expected metres, 0 or more (0.002 is 2 mm)"
            )
        self.sigma = sigma

    def apply(self, depth: Tensor, cameras: CameraBatch, generator: torch.Generator) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 stays 0, the rest stays positive.

        Args:
            depth: (B, H, W) metres, on the generator's device.
            cameras: unused; white noise looks alike through every lens.
            generator: its device is the depth's.
        """
        noise = torch.randn(depth.shape, generator=generator, device=depth.device)
        noisy = (depth + self.sigma * noise.to(depth.dtype)).clamp(min=1e-6)
        return torch.where(depth > 0, noisy, torch.zeros_like(depth))
