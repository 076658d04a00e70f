"""Tokens of a depth image: features of a small convolutional network at seen places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError
from scenefw.core.queried_sets import IMAGE
from scenefw.kernels.place_images import CHANNELS
from scenefw.models.farthest_points import farthest_points
from scenefw.models.fourier_features import WAVES, fourier_features
from scenefw.models.set_attention import attention
from scenefw.models.view_tokens import Tokens

_LEVELS = 4
_GROUPS = 8


class ImageTokens(nn.Module):
    """Sees a view as a small image of places (`kernels.place_images`), and is trained from scratch.

    Maps of four scales, each half the size of the one before, are joined from the coarsest to the
    finest as in a feature pyramid (Lin et al. 2017). Tokens are read off at seen places that are
    far from each other. The pixels of the coarsest map are tokens too, in the middle of what is
    seen there, or at the origin where nothing is.

    Args:
        encoder: `widths`, channels of the four maps, and `sees: image`.
        tokens: seen places at most.
        width: channels of a token.
        layers: of attention among them.
        heads: of attention.

    Raises:
        ConfigError: not four widths, or some that groups of 8 channels don't divide.
    """

    sees = IMAGE
    grid = None  # any will do

    def __init__(
        self, encoder: Mapping[str, Any], tokens: int, width: int, layers: int, heads: int
    ) -> None:
        super().__init__()
        widths = _checked(encoder)
        self.sizes = {"sees": IMAGE, "widths": widths}
        self.count = tokens
        stages = [_stem(widths[0]), *map(_stage, widths, widths[1:])]
        self.stages = nn.ModuleList(stages)
        self.lateral = nn.ModuleList([nn.Conv2d(channels, width, 1) for channels in widths])
        self.smooth = nn.Conv2d(width, width, 3, padding=1)
        self.place = nn.Linear(3 + 6 * WAVES, width)
        self.cell = nn.Parameter(0.02 * torch.randn(width))
        self.mixed = attention(width, layers, heads)

    def forward(self, condition: Tensor, points: Tensor, seen: Tensor) -> Tokens:
        """Tokens of views: those of seen places as `farthest_points` takes them, then coarse ones.

        Args:
            condition: (B, C, H, W) of `place_image`.
            points: (B, P, 3) m, a place for each cell of 4 x 4 pixels, row by row.
            seen: (B, P) bool.
        """
        fine, coarse = self._maps(condition)
        indices, counted = farthest_points(points, seen, self.count)
        places = points.gather(1, indices[..., None].expand(-1, -1, 3))
        rows = fine.flatten(2).transpose(1, 2)
        point_features = rows.gather(1, indices[..., None].expand(-1, -1, rows.shape[-1]))
        middles = _middles(points, seen, fine.shape[-2:], coarse.shape[-2:])
        token_places = torch.cat([places, middles], dim=1)
        token_mask = torch.cat([counted, counted.new_ones(middles.shape[:2])], dim=1)
        around = coarse.flatten(2).transpose(1, 2) + self.cell
        features = torch.cat([point_features, around], dim=1) + self.placed(token_places)
        return Tokens(
            self.mixed(features, src_key_padding_mask=~token_mask), token_places, token_mask
        )

    def placed(self, places: Tensor) -> Tensor:
        """Features (..., width) of where something is (..., 3) m."""
        features: Tensor = self.place(fourier_features(places))
        return features

    def _maps(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Joined features of cells (B, width, H / 4, W / 4), and the coarsest ones."""
        maps = []
        for stage in self.stages:
            image = stage(image)
            maps.append(image)
        features = self.lateral[-1](maps[-1])
        coarse = features
        for level in reversed(range(_LEVELS - 1)):
            finer = self.lateral[level](maps[level])
            features = finer + nn.functional.interpolate(features, size=finer.shape[-2:])
        return self.smooth(features), coarse


class _Block(nn.Module):
    """Two convolutions beside a shortcut (He et al. 2016), with group normalisation."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.inner = nn.Sequential(
            nn.GroupNorm(_GROUPS, width), nn.GELU(), nn.Conv2d(width, width, 3, padding=1),
            nn.GroupNorm(_GROUPS, width), nn.GELU(), nn.Conv2d(width, width, 3, padding=1),
        )  # fmt: skip

    def forward(self, features: Tensor) -> Tensor:
        """Features of the same shape."""
        output: Tensor = features + self.inner(features)
        return output


def _middles(points: Tensor, visible: Tensor, fine: torch.Size, coarse: torch.Size) -> Tensor:
    """Means (B, T, 3) of the seen points (B, P, 3) in each of T coarse pixels; 0 where none are."""
    counts = nn.functional.adaptive_avg_pool2d(visible.to(points.dtype).unflatten(1, fine), coarse)
    visible_points = torch.where(visible[..., None], points, 0.0).transpose(1, 2).unflatten(2, fine)
    sums = nn.functional.adaptive_avg_pool2d(visible_points, coarse)
    return (sums / counts[:, None].clamp_min(1e-6)).flatten(2).transpose(1, 2)


def _stem(width: int) -> nn.Sequential:
    """To a quarter of the image's side, one cell a pixel."""
    half = width // 2
    return nn.Sequential(
        nn.Conv2d(CHANNELS, half, 3, stride=2, padding=1), nn.GELU(),
        nn.Conv2d(half, width, 3, stride=2, padding=1), _Block(width),
    )  # fmt: skip


def _stage(channels: int, width: int) -> nn.Sequential:
    """To half the side."""
    shrink = nn.Conv2d(channels, width, 2, stride=2)
    return nn.Sequential(shrink, _Block(width), _Block(width))


def _checked(encoder: Mapping[str, Any]) -> list[int]:
    unknown_keys = set(encoder) - {"sees", "widths"}
    if unknown_keys:
        raise ConfigError(
            f"model.encoder has {', '.join(sorted(unknown_keys))}; an encoder of images has widths "
            "alone"
        )
    widths = encoder.get("widths", ())
    if not _fitting(widths):
        raise ConfigError(
            f"model.encoder.widths is {widths}; expected {_LEVELS} multiples of {_GROUPS}"
        )
    return list(widths)


def _fitting(widths: Any) -> bool:
    if not isinstance(widths, Sequence) or len(widths) != _LEVELS:
        return False
    return all(
        isinstance(channels, int) and channels > 0 and channels % _GROUPS == 0
        for channels in widths
    )
