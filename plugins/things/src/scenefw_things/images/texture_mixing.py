"""Colours that have nothing to do with what an image shows, as prints on packaging have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.settings import SHARE
from scenefw.kernels.transfer import to_device

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.part_views import PartViewBatch
    from scenefw.core.rng import Streams
    from scenefw_things.images.stored_images import StoredImages

_OWNERS = 256  # colours of an image; owners are bytes


@dataclass(frozen=True)
class TextureMixing:
    """Lays the colours of stored images over other images (after mixup, Zhang et al. 2018).

    Edges of colour then lie where nothing ends as well, so a network learns how far to trust them.

    Args:
        textures: whose colours are laid over.
        max_weight: most that they weigh; half of the images get none, others 0 to this.

    Raises:
        ConfigError: a weight outside 0..1.
    """

    textures: StoredImages
    max_weight: float

    def __post_init__(self) -> None:
        SHARE.require(max_weight=self.max_weight)

    def apply(self, batch: PartViewBatch, streams: Streams, colourless: float) -> torch.Tensor:
        """Colours (B, 3, H, W) of images, NaN where an image has none.

        Args:
            batch: of images; without colour each object gets one first.
            streams: of the images.
            colourless: chance that an image of such a batch stays without.
        """
        to_choice, to_colours = streams.split(2)
        chances = to_choice.uniform(3)
        rows = (chances[:, 0] * len(self.textures)).astype(np.int64)
        weights = self.max_weight * np.maximum(0.0, 2 * chances[:, 1] - 1)
        colour = batch.colour
        if colour is None:
            palettes = to_colours.uniform(3 * _OWNERS).reshape(-1, 3, _OWNERS)
            palettes[chances[:, 2] < colourless] = np.nan
            colour = _painted(batch, palettes)
        textures = self.textures.colour[rows].astype(np.float32) / 255
        texture, weight = to_device([textures, weights.astype(np.float32)], colour.device)
        return torch.lerp(colour, texture.permute(0, 3, 1, 2), weight[:, None, None, None])


def _painted(batch: PartViewBatch, palettes: NDArray[np.float64]) -> torch.Tensor:
    """Colours (B, 3, H, W) of the owners of pixels, from palettes (B, 3, `_OWNERS`)."""
    (colours,) = to_device([palettes.astype(np.float32)], batch.depth.device)
    owners = batch.owners.long().flatten(1)[:, None].expand(-1, 3, -1)
    return colours.gather(2, owners).view(-1, 3, *batch.depth.shape[1:])
