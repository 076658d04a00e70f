"""Variational autoencoder of sets whose prior is learned and depends on the view."""

import dataclasses
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction
from scenefw.core.settings import COUNT
from scenefw.models.blocks import Conv3d, ConvUnit, ResidualBlock
from scenefw.models.placed_head import PlacedHead
from scenefw.models.recipes import recipe_of
from scenefw.models.seen_volumes import CHANNELS
from scenefw.models.set_encoder import SetEncoder, averaged, block_side, level_sizes
from scenefw.models.set_head import require_slots

_LOGS = -8.0, 2.0  # of variances
_PRIOR = 0.99  # share of the divergence's gradient that moves the prior, not the posterior
_START = -4.0  # log variance at first: so little noise that what is drawn is worth reading


class PlacedSetVAE(nn.Module):
    """Complete scenes as sets, given a view and what was drawn for it.

    Thesis 6.2.3 compares the feature volume with N(0, I), the same in every cell, so what is drawn
    knows neither where objects are nor what the view shows. Here a network says from the view alone
    how the latent volume is distributed, mean and variance in every cell (Sohn et al. 2015), and
    the posterior, which also sees the complete scene, is kept near to that. What the latent volume
    says is added to the view's features, of which codes are taken.

    Args:
        resolution: voxels per side.
        slots: objects that it predicts; scenes with fewer leave some empty.
        code_size: numbers per object, the channels of the feature volume.
        latent_size: channels of the latent volume.
        side: cells per side of the feature volume.
        encoder_widths: channels of the levels of both encoders, coarsest first.
        decoder_widths: channels of the decoder's levels, coarsest first.
        seen_resolution: voxels per side that encoders see, as in `PlacedSetAutoencoder`.
        attention: the codes of a scene see each other before they are decoded.

    Raises:
        ConfigError: sizes don't go together.
    """

    training_only = ()

    def __init__(
        self,
        resolution: int = 64,
        slots: int = 10,
        code_size: int = 128,
        latent_size: int = 8,
        side: int = 8,
        encoder_widths: Sequence[int] = (128, 64, 32),
        decoder_widths: Sequence[int] = (96, 32),
        seen_resolution: int | None = None,
        *,
        attention: bool = True,
    ) -> None:
        super().__init__()
        self.recipe = recipe_of(self, locals())
        require_slots(slots, side)
        COUNT.require(latent_size=latent_size)
        self.block = block_side(resolution, seen_resolution)
        sizes = level_sizes(resolution // self.block, side, encoder_widths, "encoder_widths")
        widths = list(encoder_widths)[: len(sizes)][::-1]
        self.resolution, self.slots, self.sees = resolution, slots, "both"
        self.latent_shape, self.prior_sees_view = (latent_size, side, side, side), True
        self.gives = {"existence", "centres", "boxes", "divergence"}
        self.encoder = SetEncoder(CHANNELS["view"], sizes, widths, code_size)
        self.prior = Conv3d(code_size, 2 * latent_size, 1)
        self.posterior = SetEncoder(1 + CHANNELS["view"], sizes, widths, 2 * latent_size)
        self.joint = nn.Sequential(
            ConvUnit(code_size + latent_size, code_size),
            ResidualBlock(code_size),
            Conv3d(code_size, code_size, 1),
        )
        self.head = PlacedHead(
            resolution, slots, code_size, side, decoder_widths, attention=attention
        )

    def forward(
        self, batch: ObjectSetBatch, generator: torch.Generator | None = None
    ) -> ObjectSetPrediction:
        """Objects of complete scenes and their views.

        Args:
            batch: scenes and views.
            generator: of the draw from the posterior, on the CPU; None: its mean.
        """
        condition = averaged(batch.condition, self.block)
        view = self.encoder(condition)
        prior = _moments(self.prior(view))
        inputs = torch.cat([averaged(batch.occupancy, self.block), condition], dim=1)
        mean, log_variance = _moments(self.posterior(inputs))
        latent = mean
        if generator is not None:
            noise = torch.randn(mean.shape, generator=generator).to(mean)
            latent = mean + noise * (0.5 * log_variance).exp()
        return dataclasses.replace(
            self._objects(view, latent),
            latent=latent,
            divergence=_balanced((mean, log_variance), prior),
        )

    def sample(self, condition: Tensor, latent: Tensor) -> ObjectSetPrediction:
        """Objects of views (B, 2, X, Y, Z) and noise (B, L, S, S, S) of N(0, I).

        The noise becomes a draw from the prior of each view; zeros become its mean.
        """
        view = self.encoder(averaged(condition, self.block))
        mean, log_variance = _moments(self.prior(view))
        return self._objects(view, mean + latent * (0.5 * log_variance).exp())

    def _objects(self, view: Tensor, latent: Tensor) -> ObjectSetPrediction:
        inputs = torch.cat([view, latent.to(view.dtype)], dim=1)
        prediction: ObjectSetPrediction = self.head(view + self.joint(inputs))
        return prediction


def _moments(features: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and logarithm of the variance."""
    mean, log_variance = features.float().chunk(2, dim=1)
    return mean, (log_variance + _START).clamp(*_LOGS)


def _balanced(of: tuple[Tensor, Tensor], to: tuple[Tensor, Tensor]) -> Tensor:
    """The divergence, whose gradient rather brings the prior to the posterior than back.

    Else the posterior follows the prior before anything is read from it (Hafner et al. 2021).
    """
    still_of, still_to = ((mean.detach(), log_variance.detach()) for mean, log_variance in (of, to))
    return _PRIOR * _divergence(still_of, to) + (1 - _PRIOR) * _divergence(of, still_to)


def _divergence(of: tuple[Tensor, Tensor], to: tuple[Tensor, Tensor]) -> Tensor:
    """Kullback-Leibler divergence (B,) in nats of one normal distribution from another."""
    (mean, log_variance), (other_mean, other_log) = of, to
    squared = (mean - other_mean) ** 2 + log_variance.exp()
    terms = other_log - log_variance + squared / other_log.exp() - 1
    return 0.5 * terms.flatten(1).sum(dim=1)
