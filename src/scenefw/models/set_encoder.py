"""Encoder of sets: from a volume to a small volume of features."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from scenefw.core.errors import ConfigError
from scenefw.models.blocks import Conv3d, ConvUnit, ResidualBlock, space_to_depth

_REFINED = 8  # levels of this side or less have a residual block


def level_sizes(resolution: int, side: int, widths: Sequence[int], setting: str) -> list[int]:
    """Sides of levels from half the grid's down to that of the feature volume.

    Args:
        resolution: voxels per side of the grid.
        side: cells per side of the feature volume.
        widths: channels of the levels, coarsest first; further ones are not used.
        setting: the setting that gives the widths, for the message.

    Raises:
        ConfigError: halving the grid doesn't lead to the feature volume, or a width is missing.
    """
    sizes = [resolution // 2]
    while sizes[-1] > side:
        sizes.append(sizes[-1] // 2)
    if side < 2 or sizes[-1] != side or side * 2 ** len(sizes) != resolution:
        raise ConfigError(
            f"model.side is {side} cells for {resolution} voxels; expected the voxels halved once "
            "or more, and at least 2, such as 4 for 16, 32 or 64 voxels"
        )
    if len(widths) < len(sizes) or min(widths) < 1:
        raise ConfigError(
            f"model.{setting} is {list(widths)}; expected {len(sizes)} positive widths, "
            "coarsest first"
        )
    return sizes


def block_side(resolution: int, seen_resolution: int | None) -> int:
    """Voxels along each side of the blocks that an encoder of a coarser grid sees as one.

    Args:
        resolution: voxels per side of the grid.
        seen_resolution: voxels per side that the encoder sees; None: all.

    Raises:
        ConfigError: blocks don't fill the grid.
    """
    seen_resolution = resolution if seen_resolution is None else seen_resolution
    if seen_resolution < 1 or resolution % seen_resolution:
        raise ConfigError(
            f"model.seen_resolution is {seen_resolution}; expected a divisor of the grid's "
            f"{resolution} voxels per side, or null"
        )
    return resolution // seen_resolution


def averaged(volume: Tensor, block: int) -> Tensor:
    """Means of blocks of a volume (B, C, X, Y, Z)."""
    return functional.avg_pool3d(volume, block) if block > 1 else volume


class SetEncoder(nn.Module):
    """Halves the grid until the feature volume is left, whose channels take any sign.

    Blocks of 2^3 voxels become channels first. Levels of 8 cells per side and less have a residual
    block with squeeze and excitation.

    Args:
        channels: of the volume.
        sizes: sides of the levels, finest first.
        widths: channels of the levels, finest first.
        outputs: channels of the feature volume.
        condition_widths: channels of a view's maps at these sizes, or None.
    """

    def __init__(
        self,
        channels: int,
        sizes: Sequence[int],
        widths: Sequence[int],
        outputs: int,
        condition_widths: Sequence[int] | None = None,
    ) -> None:
        super().__init__()
        before = [8 * channels, *widths[:-1]]
        views = condition_widths or [0] * len(sizes)
        self.levels, self.merges = nn.ModuleList(), nn.ModuleList()
        for i, size in enumerate(sizes):
            level: list[nn.Module] = [ConvUnit(before[i], widths[i], stride=1 if i == 0 else 2)]
            if size <= _REFINED:
                level.append(ResidualBlock(widths[i]))
            self.levels.append(nn.Sequential(*level))
            if views[i]:
                self.merges.append(ConvUnit(widths[i] + views[i], widths[i], kernel=1))
        self.last = Conv3d(widths[-1], outputs, 1)

    def forward(self, volume: Tensor, maps: Sequence[Tensor] = ()) -> Tensor:
        """Features (B, C, S, S, S) of volumes (B, c, X, Y, Z).

        Args:
            volume: the grid.
            maps: of a view, at the sizes of the levels.
        """
        features = space_to_depth(volume, 2)
        for i, level in enumerate(self.levels):
            features = level(features)
            if len(self.merges):
                features = self.merges[i](torch.cat([features, maps[i]], dim=1))
        return self.last(features)
