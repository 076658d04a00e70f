"""Depth-conditioned variational autoencoder of shape and instances (SIMstack)."""

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import ShapeInstanceBatch, ShapeInstancePrediction
from scenefw.models.condition import ConditionAutoencoder
from scenefw.models.scene_decoder import SceneDecoder
from scenefw.models.scene_encoder import SceneEncoder


class ShapeInstanceVAE(nn.Module):
    """Completes a partial TSDF to full shape and centre votes (thesis 5.2.3, figs 5.19 to 5.21).

    A conditioning autoencoder feeds its feature maps to the encoder and the decoder of a shape and
    instance VAE. The encoder sees the complete scene and is dropped at test time, when the code
    comes from N(0, I), or is 0. While training, a share of the codes is replaced by such codes, so
    that the decoder has met what it gets at test time (`zero_share`, `prior_share`; both are 0 in
    the thesis). A decoder that must be right for every drawn code learns to ignore codes; so of
    several draws only the one that comes nearest to the truth is trained on (best of many,
    Bhattacharyya et al. 2018; `candidates`).

    Args:
        resolution: voxels per side, a power of two of at least 8.
        channels: channels of the condition: 1 partial TSDF, 2 also what was observed.
        latent_size: size of the latent code.
        bottleneck: size of the conditioning autoencoder's code.
        condition_widths: channels of its five layers, finest first.
        encoder_widths: channels of the encoder's five joint levels, finest first.
        decoder_widths: channels of the decoder's five joint levels, finest first.
        stem_width: channels of the encoder's layers of one modality.
        branch_width: channels of the decoder's fine layer, at half the grid's side.
        zero_share: share of a training batch whose codes are replaced by the zero code.
        prior_share: share of a training batch whose codes are replaced by draws from N(0, I).
        candidates: draws for each of the latter, of which the best is kept.

    Raises:
        ConfigError: a width list has not five entries, or the resolution is no power of two.
    """

    training_only = ("encoder",)

    def __init__(
        self,
        resolution: int = 64,
        channels: int = 2,
        latent_size: int = 96,
        bottleneck: int = 96,
        condition_widths: Sequence[int] = (16, 32, 48, 64, 96),
        encoder_widths: Sequence[int] = (32, 48, 64, 64, 64),
        decoder_widths: Sequence[int] = (48, 64, 96, 128, 128),
        stem_width: int = 16,
        branch_width: int = 16,
        zero_share: float = 0.1,
        prior_share: float = 0.4,
        candidates: int = 3,
    ) -> None:
        super().__init__()
        self.recipe = _recipe(locals())
        _check(resolution, channels, condition_widths, encoder_widths, decoder_widths)
        _check_shares(zero_share, prior_share, candidates)
        self.resolution, self.channels, self.latent_size = resolution, channels, latent_size
        self.zero_share, self.prior_share, self.candidates = zero_share, prior_share, candidates
        fine = [max(resolution // 2 >> i, 2) for i in range(6)]
        widths = list(condition_widths)
        self.condition = ConditionAutoencoder(channels, fine[:5], widths, bottleneck)
        # The code of the condition stands for a sixth map; its place is taken by the coarsest map.
        joint, maps = fine[1:], [*widths[1:], widths[4]]
        self.encoder: SceneEncoder | None = SceneEncoder(
            joint, list(encoder_widths), maps, stem_width, latent_size
        )
        self.decoder = SceneDecoder(
            joint[::-1],
            list(decoder_widths)[::-1],
            [*widths[::-1], channels * 8],
            branch_width,
            latent_size + bottleneck,
        )

    def forward(
        self, batch: ShapeInstanceBatch, generator: torch.Generator | None = None
    ) -> ShapeInstancePrediction:
        """Training pass: codes from the encoder, a share replaced.

        Without a generator the codes are the posterior means.
        """
        if self.encoder is None:
            raise InputError(
                "this network was stored without its encoder, so it only predicts; train with "
                "run=train, which goes on from the state in paths.training"
            )
        maps, view = self.condition.encode(batch.condition)
        mean, log_variance = self.encoder(batch.tsdf, batch.votes, [*maps[2:], maps[5]])
        latent, code = mean, mean
        if generator is not None:
            noise = _normal(mean, generator)
            latent = mean + noise * (0.5 * log_variance).exp()
            code = self._replace(latent, view, maps, batch.tsdf, generator)
        tsdf, votes = self.decoder(torch.cat([code, view], dim=1), maps[::-1])
        statistics = {"mean": mean, "log_variance": log_variance}
        return ShapeInstancePrediction(tsdf, votes, self.condition.decode(view), latent, statistics)

    def predict(self, condition: Tensor, latent: Tensor | None = None) -> ShapeInstancePrediction:
        """Test pass without the encoder.

        Args:
            condition: (B, C, X, Y, Z), distances in units of the truncation.
            latent: (B, latent_size) codes, or (S B, latent_size) for S codes per condition, sample
                after sample; None means the zero code.

        Returns:
            B (or S B) predictions, distances within [-1, 1].

        Raises:
            InputError: the shapes don't fit the network.
        """
        self._check_condition(condition)
        maps, view = self.condition.encode(condition)
        if latent is None:
            latent = view.new_zeros(len(view), self.latent_size)
        samples = self._samples(latent, len(view))
        view = view.repeat(samples, 1)
        maps = [m.repeat(samples, 1, 1, 1, 1) if samples > 1 else m for m in maps]
        tsdf, votes = self.decoder(torch.cat([latent, view], dim=1), maps[::-1])
        return ShapeInstancePrediction(tsdf.clamp(-1, 1), votes, latent=latent)

    def _replace(
        self,
        latent: Tensor,
        view: Tensor,
        maps: list[Tensor],
        truth: Tensor,
        generator: torch.Generator,
    ) -> Tensor:
        """Codes of which the first are the zero code, and the next drawn from the prior."""
        zeros = round(self.zero_share * len(latent))
        end = round((self.zero_share + self.prior_share) * len(latent))
        rows = slice(zeros, end)
        drawn = [_normal(latent[rows], generator) for _ in range(self.candidates)]
        if len(drawn) > 1 and end > zeros:
            drawn = [self._best(drawn, view[rows], [m[rows] for m in maps], truth[rows])]
        return torch.cat([torch.zeros_like(latent[:zeros]), drawn[0], latent[end:]])

    @torch.no_grad()
    def _best(self, drawn: list[Tensor], view: Tensor, maps: list[Tensor], truth: Tensor) -> Tensor:
        """Of several codes per scene the one whose shape is nearest to the truth."""
        training = self.decoder.training
        self.decoder.eval()
        errors = [
            (self.decoder.shape(torch.cat([code, view], dim=1), maps[::-1]).clamp(-1, 1) - truth)
            .abs()
            .mean(dim=(1, 2, 3, 4))
            for code in drawn
        ]
        self.decoder.train(training)
        best = torch.stack(errors).argmin(dim=0)
        return torch.stack(drawn)[best, torch.arange(len(best), device=best.device)]

    def _samples(self, latent: Tensor, batch: int) -> int:
        if latent.ndim != 2 or latent.shape[1] != self.latent_size or len(latent) % batch:
            raise InputError(
                f"latent codes have shape {tuple(latent.shape)}, expected "
                f"({batch}, {self.latent_size}) or a multiple of {batch} rows"
            )
        return len(latent) // batch

    def _check_condition(self, condition: Tensor) -> None:
        expected = (self.channels, *(self.resolution,) * 3)
        if condition.ndim != 5 or tuple(condition.shape[1:]) != expected:
            raise InputError(
                f"condition has shape {tuple(condition.shape)}, expected (B, {expected[0]}, "
                f"{expected[1]}, {expected[2]}, {expected[3]}); use the grid of the checkpoint"
            )


def _normal(like: Tensor, generator: torch.Generator) -> Tensor:
    noise = torch.randn(like.shape, generator=generator, device=generator.device)
    return noise.to(like.device, like.dtype)


def _recipe(arguments: dict[str, Any]) -> dict[str, Any]:
    """What rebuilds the network: its class and plain arguments."""
    recipe: dict[str, Any] = {"_target_": f"{__name__}.ShapeInstanceVAE"}
    for name, value in arguments.items():
        if name not in ("self", "__class__"):
            recipe[name] = value if isinstance(value, (int, float)) else [int(v) for v in value]
    return recipe


def _check_shares(zero: float, prior: float, candidates: int) -> None:
    if not (zero >= 0 and prior >= 0 and zero + prior <= 1 and candidates >= 1):
        raise ConfigError(
            f"model.zero_share is {zero}, prior_share {prior}, candidates {candidates}; expected "
            "shares that add up to at most 1, and at least 1 candidate"
        )


def _check(resolution: int, channels: int, *widths: Sequence[int]) -> None:
    if resolution < 8 or resolution & (resolution - 1):
        raise ConfigError(
            f"the network's resolution is {resolution}, expected a power of two of at least 8 "
            "(grid.resolution)"
        )
    if channels not in (1, 2):
        raise ConfigError(f"the condition has 1 or 2 channels, got {channels} (model.channels)")
    for name, entry in zip(("condition", "encoder", "decoder"), widths, strict=True):
        if len(entry) != 5 or min(entry) < 1:
            raise ConfigError(
                f"model.{name}_widths is {list(entry)}, expected five positive widths"
            )
