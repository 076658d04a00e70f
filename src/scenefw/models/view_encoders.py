"""Which encoder tells a decoder of sets what a view shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import nn

from scenefw.core.errors import ConfigError
from scenefw.core.queried_sets import IMAGE
from scenefw.core.training_protocols import TrainedOnGrid
from scenefw.models.image_tokens import ImageTokens
from scenefw.models.view_tokens import ViewTokens


def encoder_of(
    encoder: TrainedOnGrid[nn.Module] | Mapping[str, Any],
    tokens: int,
    width: int,
    layers: int,
    heads: int,
    *,
    frozen: bool,
) -> ViewTokens | ImageTokens:
    """The encoder of volumes of a trained network, or a new one of images.

    Args:
        encoder: a trained network of volumes, or sizes; `sees: image` makes one of images.
        tokens: seen points at most.
        width: channels of a token.
        layers: of attention among them.
        heads: of attention.
        frozen: leave a trained encoder as it is.

    Raises:
        ConfigError: the network has no encoder of views, or sizes mean nothing.
    """
    if isinstance(encoder, Mapping) and "sees" in encoder:
        if encoder["sees"] != IMAGE:
            raise ConfigError(
                f"model.encoder.sees is {encoder['sees']}; expected {IMAGE}, or weights of a "
                "network of volumes by model.encoder.path"
            )
        return ImageTokens(encoder, tokens, width, layers, heads)
    return ViewTokens(encoder, tokens, width, layers, heads, frozen=frozen)
