"""Depth-conditioned variational autoencoder of sets: a distribution over feature volumes."""

import dataclasses
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction
from scenefw.models.condition import ConditionAutoencoder
from scenefw.models.recipes import recipe_of
from scenefw.models.seen_volumes import CHANNELS
from scenefw.models.set_decoder import SetDecoder
from scenefw.models.set_encoder import SetEncoder, level_sizes
from scenefw.models.set_head import SetHead, heads_given, require_slots


class SetVAE(nn.Module):
    """Complete scenes as sets, given one view and a drawn feature volume (thesis 6.2.3, fig. 6.12).

    The encoder sees the complete occupancy and the view's features, and says a normal distribution
    of the feature volume. Codes are taken from a draw of it; the decoder, which all objects share,
    sees the view's features too. Without the complete scene, the volume is drawn from N(0, I).

    Args:
        resolution: voxels per side.
        slots: objects that it predicts; scenes with fewer leave some empty.
        code_size: numbers per object, the channels of the feature volume.
        side: cells per side of the feature volume.
        encoder_widths: channels of the encoder's levels, coarsest first, as many as are needed.
        decoder_widths: the same of the decoder.
        condition_widths: channels of the conditioning autoencoder's five layers, finest first.
        bottleneck: size of its code.
        existence: also predict for each object whether it is there.
        centres: also predict where each object's centre is.
        attention: the codes of a scene see each other before they are decoded.

    Raises:
        ConfigError: sizes don't go together.
    """

    training_only = ()

    def __init__(
        self,
        resolution: int = 64,
        slots: int = 8,
        code_size: int = 64,
        side: int = 4,
        encoder_widths: Sequence[int] = (96, 64, 32, 16),
        decoder_widths: Sequence[int] = (96, 48, 24, 16),
        condition_widths: Sequence[int] = (16, 32, 48, 64, 64),
        bottleneck: int = 64,
        *,
        existence: bool = False,
        centres: bool = False,
        attention: bool = False,
    ) -> None:
        super().__init__()
        self.recipe = recipe_of(self, locals())
        require_slots(slots, side)
        sizes = level_sizes(resolution, side, encoder_widths, "encoder_widths")
        level_sizes(resolution, side, decoder_widths, "decoder_widths")
        maps = _map_widths(condition_widths, len(sizes))
        levels = len(sizes)
        self.resolution, self.slots, self.sees = resolution, slots, "both"
        self.latent_shape, self.prior_sees_view = (code_size, side, side, side), False
        self.gives = heads_given(existence=existence, centres=centres) | {"partial", "latent"}
        fine = [max(resolution // 2 >> i, 2) for i in range(5)]
        self.condition = ConditionAutoencoder(
            CHANNELS["view"], fine, list(condition_widths), bottleneck
        )
        self.encoder = SetEncoder(
            1, sizes, list(encoder_widths)[:levels][::-1], 2 * code_size, maps
        )
        decoder = SetDecoder(code_size, sizes[::-1], list(decoder_widths)[:levels], maps[::-1])
        self.head = SetHead(
            slots,
            code_size,
            decoder,
            existence=existence,
            centres=centres,
            attention=attention,
        )

    def forward(
        self, batch: ObjectSetBatch, generator: torch.Generator | None = None
    ) -> ObjectSetPrediction:
        """Objects of complete scenes and their views.

        Args:
            batch: scenes and views.
            generator: of the draw from the posterior, on the CPU; None: its mean.
        """
        maps, view = self._view(batch.condition)
        moments = self.encoder(batch.occupancy, maps).float()
        mean, log_variance = moments.chunk(2, dim=1)
        latent = mean
        if generator is not None:
            noise = torch.randn(mean.shape, generator=generator).to(mean)
            latent = mean + noise * (0.5 * log_variance.clamp(-10.0, 4.0)).exp()
        prediction: ObjectSetPrediction = self.head(latent, maps[::-1])
        partial = self.condition.decode(view)
        return dataclasses.replace(prediction, partial=partial, latent=latent)

    def sample(self, condition: Tensor, latent: Tensor) -> ObjectSetPrediction:
        """Objects of views (B, 2, X, Y, Z) and feature volumes (B, C, S, S, S) of N(0, I)."""
        maps, _ = self._view(condition)
        prediction: ObjectSetPrediction = self.head(latent, maps[::-1])
        return prediction

    def _view(self, condition: Tensor) -> tuple[list[Tensor], Tensor]:
        """The view's maps at the sizes of the levels, finest first, and its code."""
        maps, code = self.condition.encode(condition)
        return maps[1 : len(self.encoder.levels) + 1], code


def _map_widths(widths: Sequence[int], levels: int) -> list[int]:
    if len(widths) != 5 or min(widths) < 1 or levels > 5:
        raise ConfigError(
            f"model.condition_widths is {list(widths)}; expected five positive widths, finest first"
        )
    return list(widths)[:levels]
