"""The fully convolutional baseline: complete shape and votes in one pass."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError
from scenefw.core.protocols import Representation
from scenefw.models.blocks import (
    Conv3d,
    ConvUnit,
    ResidualBlock,
    UpUnit,
    depth_to_space,
    space_to_depth,
)
from scenefw_single_view_benchmarks.baselines.direct_completion import DirectCompletion, channels_of

_MIN_SIDE = 2  # voxels per side of the coarsest level


class FullyConvolutional(DirectCompletion):
    """The FC baseline (thesis 5.2.2, fig. 5.16): an encoder, and a decoder for each volume.

    Every level has a SE-residual block; the encoder's maps go to all decoders at their size. There
    is no bottleneck of one code. As in `ShapeInstanceVAE` the finest level works on blocks of 2^3
    voxels.

    Args:
        resolution: voxels per side, a power of two of at least 8.
        channels: of the condition that it sees: 1 partial TSDF, 2 also what was observed.
        widths: channels of the levels, finest first; each has half the side of the one before, but
            at least 2.
        outputs: volumes that it predicts, by name: their representations, or their numbers of
            channels.

    Raises:
        ConfigError: no width, or a resolution that is no power of two.
    """

    def __init__(
        self,
        resolution: int,
        outputs: Mapping[str, Representation | int],
        channels: int = 2,
        widths: Sequence[int] = (16, 32, 48, 64, 96),
    ) -> None:
        if not widths or min(widths) < 1:
            raise ConfigError(f"model.widths is {list(widths)}, expected positive widths")
        recipe = {
            "_target_": f"{__name__}.{type(self).__name__}",
            "resolution": resolution,
            "channels": channels,
            "widths": [int(width) for width in widths],
        }
        super().__init__(recipe, resolution, channels, channels_of(outputs), 8)
        if resolution & (resolution - 1):
            raise ConfigError(f"the network's resolution is {resolution}, expected a power of two")
        sizes = [max(resolution // 2 >> level, _MIN_SIDE) for level in range(len(widths))]
        strides = [finer // coarser for finer, coarser in pairwise(sizes)]
        levels = [nn.Sequential(ConvUnit(8 * channels, widths[0]), ResidualBlock(widths[0]))]
        for (finer, width), stride in zip(pairwise(widths), strides, strict=True):
            unit = ConvUnit(finer, width, stride=stride)
            levels.append(nn.Sequential(unit, ResidualBlock(width)))
        self.levels = nn.ModuleList(levels)
        self.branches = nn.ModuleDict(
            {n: _Branch(widths, strides, 8 * channels, c) for n, c in self.outputs.items()}
        )

    def volumes(self, condition: Tensor) -> dict[str, Tensor]:
        """Volumes (B, C, X, Y, Z) by name."""
        blocks = space_to_depth(condition, 2)
        maps, features = [], blocks
        for level in self.levels:
            features = level(features)
            maps.append(features)
        return {name: branch(maps, blocks) for name, branch in self.branches.items()}


class _Branch(nn.Module):
    """The decoder of one volume, whose last layer also sees the condition."""

    def __init__(
        self, widths: Sequence[int], strides: Sequence[int], condition: int, outputs: int
    ) -> None:
        super().__init__()
        steps = []
        for width, finer, stride in zip(widths[:0:-1], widths[-2::-1], strides[::-1], strict=True):
            up, merge = UpUnit(width, finer, stride=stride), ConvUnit(2 * finer, finer)
            steps.append(nn.ModuleList([up, merge, ResidualBlock(finer)]))
        self.steps = nn.ModuleList(steps)
        self.last = Conv3d(widths[0] + condition, 8 * outputs, 1)

    def forward(self, maps: Sequence[Tensor], blocks: Tensor) -> Tensor:
        features = maps[-1]
        for (up, merge, block), beside in zip(self.steps, maps[-2::-1], strict=True):  # type: ignore[misc]
            features = block(merge(torch.cat([up(features), beside], dim=1)))
        merged = torch.cat([features, blocks.to(features.dtype)], dim=1)
        return depth_to_space(self.last(merged), 2)
