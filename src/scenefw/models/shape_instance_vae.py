"""Depth-conditioned variational autoencoder of shape and instances (SIMstack)."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn

from scenefw.core.batches import RedrawnShapes, ShapeInstanceBatch, ShapeInstancePrediction
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.protocols import Representation
from scenefw.models.condition import ConditionAutoencoder
from scenefw.models.recipes import recipe_of
from scenefw.models.scene_decoder import STANDARD, SceneDecoder
from scenefw.models.scene_encoder import SceneEncoder


class ShapeInstanceVAE(nn.Module):
    """Completes a partial TSDF to full shape and centre votes (thesis 5.2.3, figs 5.19 to 5.21).

    A conditioning autoencoder feeds its feature maps to the encoder and the decoder of a shape and
    instance VAE. The encoder sees the complete scene and is dropped at test time, when the code
    comes from N(0, I), or is 0. While training, a share of the codes is replaced by such codes, so
    that the decoder has met what it gets at test time (`zero_share`, `prior_share`; both are 0 in
    the thesis). A decoder that must be right for every drawn code learns to ignore codes; so each
    view with a drawn code gets a second one, and the loss `sample_spread` rewards what differs.
    If all codes are replaced, there is no encoder.

    Args:
        resolution: voxels per side, a power of two of at least 8.
        channels: channels of the condition that it sees: 1 partial TSDF, 2 also what was observed;
            0 none, which makes it the thesis's unconditional VAE (5.2.2).
        latent_size: size of the latent code.
        bottleneck: size of the conditioning autoencoder's code.
        condition_widths: channels of its five layers, finest first.
        encoder_widths: channels of the encoder's five joint levels, finest first.
        decoder_widths: channels of the decoder's five joint levels, finest first.
        stem_width: channels of the encoder's layers of one modality.
        branch_width: channels of the decoder's fine layer, at half the grid's side.
        code_width: channels of a map at an eighth of the grid's side that the latent code gives
            directly; 0 = none, as in the thesis.
        zero_share: share of a training batch whose codes are replaced by the zero code.
        prior_share: share of a training batch whose codes are replaced by draws from N(0, I),
            two for each view.
        outputs: volumes that it predicts, by name: their representations, or their numbers of
            channels; None: tsdf and votes. Each further one has its own layer at the end.

    Raises:
        ConfigError: a width list has not five entries, or the resolution is not a power of two.
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
        code_width: int = 8,
        zero_share: float = 0.1,
        prior_share: float = 0.9,
        outputs: Mapping[str, Representation | int] | None = None,
    ) -> None:
        super().__init__()
        self.outputs = _channels(outputs)
        self.recipe = recipe_of(self, {**locals(), "outputs": self.outputs})
        if self.outputs == STANDARD:  # files of earlier versions name no outputs
            del self.recipe["outputs"]
        _check(resolution, channels, condition_widths, encoder_widths, decoder_widths)
        _check_shares(zero_share, prior_share)
        self.resolution, self.channels, self.latent_size = resolution, channels, latent_size
        self.zero_share, self.prior_share = zero_share, prior_share
        fine = [max(resolution // 2 >> i, 2) for i in range(6)]
        widths = list(condition_widths)
        self.condition = ConditionAutoencoder(max(channels, 1), fine[:5], widths, bottleneck)
        # The code of the condition stands for a sixth map; its place is taken by the coarsest map.
        joint, maps = fine[1:], [*widths[1:], widths[4]]
        self.encoder: SceneEncoder | None = None
        if zero_share + prior_share < 1:
            self.encoder = SceneEncoder(
                joint, list(encoder_widths), maps, stem_width, latent_size, self.outputs
            )
        self.decoder = SceneDecoder(
            joint[::-1],
            list(decoder_widths)[::-1],
            [*widths[::-1], max(channels, 1) * 8],
            branch_width,
            latent_size + bottleneck,
            latent_size,
            code_width,
            self.outputs,
        )

    def forward(
        self,
        batch: ShapeInstanceBatch,
        generator: torch.Generator | None = None,
        *,
        draw: bool = True,
    ) -> ShapeInstancePrediction:
        """Training pass: codes from the encoder, a share replaced.

        Without a generator the codes are the posterior means. Without `draw` zero takes the place
        of codes from the prior. `latent` and `statistics` are of the rows that the encoder saw, the
        last ones.
        """
        count = len(batch.condition)
        zeros, redrawn_rows = (
            self._replaced(count, draw=draw) if generator is not None else (0, slice(0, 0))
        )
        maps, view = self.condition.encode(self._input_channels(batch.condition))
        latent, statistics = self._posterior(batch, maps, redrawn_rows.stop, generator)
        codes = [
            view.new_zeros(zeros, self.latent_size),
            *self._draws(view[redrawn_rows], generator),
        ]
        first = torch.cat([*codes[:2], *([] if latent is None else [latent])])
        code = torch.cat([first, *codes[2:]])
        views = torch.cat([view, view[redrawn_rows]])
        volumes = self.decoder(
            torch.cat([code, views], dim=1), [torch.cat([m, m[redrawn_rows]]) for m in maps[::-1]]
        )
        redrawn = None
        if len(code) > count:
            redrawn = RedrawnShapes(redrawn_rows, {name: v[count:] for name, v in volumes.items()})
        partial = self.condition.decode(view)
        volumes = {name: v[:count] for name, v in volumes.items()}
        return ShapeInstancePrediction(volumes, partial, latent, statistics, redrawn)

    def predict(self, condition: Tensor, latent: Tensor | None = None) -> ShapeInstancePrediction:
        """Test pass without the encoder.

        Args:
            condition: (B, 2, X, Y, Z), distances in units of the truncation; or its first channels,
                as many as the network sees.
            latent: (B, latent_size) codes, or (S B, latent_size) for S codes per condition, sample
                after sample; None means the zero code.

        Returns:
            B (or S B) predictions, distances within [-1, 1].

        Raises:
            InputError: the shapes don't fit the network.
        """
        self._check_condition(condition)
        maps, view = self.condition.encode(self._input_channels(condition))
        if latent is None:
            latent = view.new_zeros(view.shape[0], self.latent_size)
        samples = self._samples(latent, view.shape[0])
        view = view.repeat(samples, 1)
        maps = [m.repeat(samples, 1, 1, 1, 1) if samples > 1 else m for m in maps]
        volumes = self.decoder(torch.cat([latent, view], dim=1), maps[::-1])
        if "tsdf" in volumes:
            volumes["tsdf"] = volumes["tsdf"].clamp(-1, 1)
        return ShapeInstancePrediction(volumes, latent=latent)

    def _input_channels(self, condition: Tensor) -> Tensor:
        """Its channels of the condition; zeros if it sees none."""
        return condition[:, : self.channels] if self.channels else 0 * condition[:, :1]

    def redraws(self, count: int) -> int:
        """How many rows of a training batch get two codes from the prior."""
        _, redrawn_rows = self._replaced(count, draw=True)
        return redrawn_rows.stop - redrawn_rows.start

    def _replaced(self, count: int, *, draw: bool) -> tuple[int, slice]:
        """How many of a batch's first rows take the zero code, and which of the next drawn ones."""
        end = round((self.zero_share + self.prior_share) * count)
        zeros = round(self.zero_share * count) if draw else end
        return zeros, slice(zeros, end)

    def _draws(self, views: Tensor, generator: torch.Generator | None) -> list[Tensor]:
        """Two codes from the prior for each of some views."""
        if generator is None or not len(views):
            return []
        like = views[:, :1].expand(-1, self.latent_size)
        return [_normal(like, generator) for _ in range(2)]

    def _posterior(
        self,
        batch: ShapeInstanceBatch,
        maps: list[Tensor],
        start: int,
        generator: torch.Generator | None,
    ) -> tuple[Tensor | None, dict[str, Tensor]]:
        """Codes of the complete scenes from row `start` on, and their mean and log-variance."""
        if start == len(batch.condition):
            return None, {}
        if self.encoder is None:
            raise InputError(
                "this network was stored without its encoder, so it only predicts; train with "
                "run=train, which resumes from the state in paths.training"
            )
        features = [m[start:] for m in [*maps[2:], maps[5]]]
        mean, log_variance = self.encoder(
            {name: batch.targets[name][start:] for name in self.outputs}, features
        )
        statistics = {"mean": mean, "log_variance": log_variance}
        if generator is None:
            return mean, statistics
        return mean + _normal(mean, generator) * (0.5 * log_variance).exp(), statistics

    def _samples(self, latent: Tensor, batch: int) -> int:
        if latent.ndim != 2 or latent.shape[1] != self.latent_size or latent.shape[0] % batch:
            raise InputError(
                f"latent codes have shape {tuple(latent.shape)}, expected "
                f"({batch}, {self.latent_size}) or a multiple of {batch} rows"
            )
        return latent.shape[0] // batch

    def _check_condition(self, condition: Tensor) -> None:
        size, shape = (self.resolution,) * 3, tuple(condition.shape)
        if len(shape) != 5 or shape[2:] != size or shape[1] < self.channels:
            raise InputError(
                f"condition has shape {shape}, expected (B, 2, {size[0]}, {size[1]}, {size[2]}); "
                "use the grid of the checkpoint"
            )


def _normal(like: Tensor, generator: torch.Generator) -> Tensor:
    """From the generator, on its device; pinned where the copy would make the host wait."""
    pinned = like.is_cuda and generator.device.type == "cpu"
    noise = torch.randn(like.shape, generator=generator, device=generator.device, pin_memory=pinned)
    return noise.to(like.device, non_blocking=True).to(like.dtype)


def _channels(outputs: Mapping[str, Representation | int] | None) -> dict[str, int]:
    """Channels of each output."""
    channels = {
        name: output if isinstance(output, int) else output.channels
        for name, output in (outputs or {}).items()
    }
    return dict(STANDARD) if not channels or channels == STANDARD else channels


def _check_shares(zero: float, prior: float) -> None:
    if not (zero >= 0 and prior >= 0 and zero + prior <= 1):
        raise ConfigError(
            f"model.zero_share is {zero} and prior_share {prior}; expected shares that add up "
            "to at most 1"
        )


def _check(resolution: int, channels: int, *widths: Sequence[int]) -> None:
    if resolution < 8 or resolution & (resolution - 1):
        raise ConfigError(
            f"the network's resolution is {resolution}, expected a power of two of at least 8 "
            "(grid.resolution)"
        )
    if channels not in (0, 1, 2):
        raise ConfigError(f"the condition has 0 to 2 channels, got {channels} (model.channels)")
    for name, entry in zip(("condition", "encoder", "decoder"), widths, strict=True):
        if len(entry) != 5 or min(entry) < 1:
            raise ConfigError(
                f"model.{name}_widths is {list(entry)}, expected five positive widths"
            )
