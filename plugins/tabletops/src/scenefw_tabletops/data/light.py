"""Other light and other cameras: colours of images changed at random."""

import torch
from torch import Tensor

from scenefw.core.rng import Streams
from scenefw.core.settings import below
from scenefw.core.types import Float64


class ColourJitter:
    """Changes brightness, contrast and tint, drawn for each image.

    Args:
        brightness: factors are drawn from 1 +- this.
        contrast: the same, about the image's mean.
        tint: the same, for each of the three colours.
    """

    def __init__(self, brightness: float = 0.2, contrast: float = 0.2, tint: float = 0.05) -> None:
        below(1).require(brightness=brightness, contrast=contrast, tint=tint)
        self.brightness, self.contrast, self.tint = brightness, contrast, tint

    def draw(self, streams: Streams) -> Float64:
        """Factors of three colours and of the contrast of one image per stream, (B, 4)."""
        share = 2 * streams.uniform(5) - 1
        gain = (1 + share[:, :3] * self.tint) * (1 + share[:, 3:4] * self.brightness)
        factors = share[:, 1:].copy()
        factors[:, :3], factors[:, 3] = gain, 1 + share[:, 4] * self.contrast
        return factors

    def apply(self, colour: Tensor, factors: Tensor) -> Tensor:
        """Images (B, 3, H, W) in [0, 1] in another light, by float32 factors (B, 4)."""
        gain, contrast = factors[:, :3, None, None], factors[:, 3:, None, None]
        mean = torch.stack([image.mean() for image in colour])[:, None, None, None]
        return (((colour - mean) * contrast + mean) * gain).clamp(0, 1)
