"""Tokens of a partial view: trained features at seen points, and of coarse cells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError
from scenefw.core.queried_sets import VOLUME
from scenefw.core.training_protocols import TrainedOnGrid
from scenefw.core.types import GridSpec
from scenefw.models.blocks import space_to_depth
from scenefw.models.condition import ConditionAutoencoder
from scenefw.models.farthest_points import farthest_points
from scenefw.models.fourier_features import WAVES, fourier_features
from scenefw.models.set_attention import attention

_CELLS = 4  # per side of the coarse map


class Tokens(NamedTuple):
    """What is known of B views.

    Args:
        features: (B, T, width).
        places: (B, T, 3) m, world.
        counted: (B, T) bool.
    """

    features: Tensor
    places: Tensor
    counted: Tensor


class ViewTokens(nn.Module):
    """Sees a view through the condition encoder of a network of volumes (`shape_instance_vae`).

    Its maps of all scales are read off where something is seen, at points far from each other. Its
    coarse maps are tokens too, so there is something to attend to in a view that shows nothing.

    Args:
        encoder: the trained network of volumes; or `sizes_of` one, to be filled with weights.
        tokens: seen points at most.
        width: channels of a token.
        layers: of attention among them.
        heads: of attention.
        frozen: leave the encoder as it is trained.

    Raises:
        ConfigError: the network has no such encoder.
    """

    sees = VOLUME

    def __init__(
        self,
        encoder: TrainedOnGrid[nn.Module] | Mapping[str, Any],
        tokens: int,
        width: int,
        layers: int,
        heads: int,
        *,
        frozen: bool,
    ) -> None:
        super().__init__()
        self.sizes = sizes_of(encoder)
        self.grid = GridSpec(
            **{name: self.sizes[name] for name in ("resolution", "extent", "truncation_voxels")},
            lower=tuple(self.sizes["lower"]),
        )
        self.count, self.frozen = tokens, frozen
        widths = self.sizes["widths"]
        fine = [max(self.grid.resolution // 2 >> i, 2) for i in range(5)]
        self.encoder = ConditionAutoencoder(self.sizes["channels"], fine, widths, 1).layers
        if not isinstance(encoder, Mapping):
            self.encoder.load_state_dict(encoder.model.condition.layers.state_dict())
        self.encoder.requires_grad_(not frozen)
        total = sum(widths)
        self.seen = nn.Sequential(
            nn.LayerNorm(total), nn.Linear(total, width), nn.GELU(), nn.Linear(width, width)
        )
        self.cell = nn.Sequential(nn.LayerNorm(sum(widths[3:])), nn.Linear(sum(widths[3:]), width))
        self.place = nn.Linear(3 + 6 * WAVES, width)
        self.mixed = attention(width, layers, heads)

    def train(self, mode: bool = True) -> ViewTokens:
        """As of any module; a frozen encoder goes on to predict, statistics and all."""
        super().train(mode)
        if self.frozen:
            self.encoder.eval()
        return self

    def forward(self, condition: Tensor, points: Tensor, seen: Tensor) -> Tokens:
        """Tokens of views: first those of seen points, as `farthest_points` takes them, then cells.

        Args:
            condition: (B, 2, X, Y, Z), distances in units of the truncation.
            points: (B, P, 3) m, world.
            seen: (B, P) bool.
        """
        maps = self._maps(condition[:, : self.sizes["channels"]])
        indices, counted = farthest_points(points, seen, self.count)
        places = points.gather(1, indices[..., None].expand(-1, -1, 3))
        point_features = torch.cat(
            [self._sample(feature_map, places) for feature_map in maps], dim=-1
        )
        coarse = torch.cat(
            [_resized(feature_map).flatten(2) for feature_map in maps[3:]], dim=1
        ).transpose(1, 2)
        features = torch.cat([self.seen(point_features), self.cell(coarse)], dim=1)
        cells = self._cells(places).expand(len(places), -1, -1)
        token_places = torch.cat([places, cells], dim=1)
        token_mask = torch.cat([counted, counted.new_ones(cells.shape[:2])], dim=1)
        features = self.mixed(
            features + self.placed(token_places), src_key_padding_mask=~token_mask
        )
        return Tokens(features, token_places, token_mask)

    def placed(self, places: Tensor) -> Tensor:
        """Features (..., width) of where something is (..., 3) m."""
        features: Tensor = self.place(fourier_features(places))
        return features

    def _maps(self, condition: Tensor) -> list[Tensor]:
        """Features of all scales, finest first, half the grid's side and less."""
        with torch.set_grad_enabled(torch.is_grad_enabled() and not self.frozen):
            features, maps = space_to_depth(condition, 2), []
            for layer in self.encoder:
                features = layer(features)
                maps.append(features)
        return maps

    def _sample(self, features: Tensor, places: Tensor) -> Tensor:
        """Features (B, T, C) of a map (B, C, X, Y, Z) at places (B, T, 3), between its cells."""
        lower = places.new_tensor(self.grid.lower)
        inside = (places - lower) * (2 / self.grid.extent) - 1
        at = inside.flip(-1)[:, :, None, None].to(
            features.dtype
        )  # grid_sample counts from the last
        samples = nn.functional.grid_sample(
            features, at, padding_mode="border", align_corners=False
        )
        return samples[..., 0, 0].transpose(1, 2)

    def _cells(self, like: Tensor) -> Tensor:
        """Centres (1, cells, 3) of the coarse map's cells (m)."""
        side = self.grid.extent / _CELLS
        centres = (torch.arange(_CELLS, device=like.device, dtype=like.dtype) + 0.5) * side
        places = torch.stack(torch.meshgrid(centres, centres, centres, indexing="ij"), dim=-1)
        return (places + like.new_tensor(self.grid.lower)).flatten(0, 2)[None]


def sizes_of(encoder: TrainedOnGrid[nn.Module] | Mapping[str, Any]) -> dict[str, Any]:
    """Plain sizes of a view encoder, and the grid that it sees.

    Raises:
        ConfigError: the network has no such encoder.
    """
    if isinstance(encoder, Mapping):
        return dict(encoder)
    recipe, grid = encoder.recipe, encoder.grid
    if not {"resolution", "condition_widths"} <= set(recipe) or not recipe.get("channels", 2):
        raise ConfigError(
            f"model.encoder is a {recipe.get('_target_')}, which has no encoder of views; give "
            "weights of model=shape_instance_vae"
        )
    return {
        "resolution": grid.resolution,
        "extent": grid.extent,
        "lower": list(grid.lower),
        "truncation_voxels": grid.truncation_voxels,
        "channels": recipe.get("channels", 2),
        "widths": list(recipe["condition_widths"]),
    }


def _resized(features: Tensor) -> Tensor:
    """A map at the side of the coarse cells."""
    return nn.functional.interpolate(features, size=(_CELLS,) * 3, mode="nearest")
