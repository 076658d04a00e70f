"""Conditioning autoencoder: features of the partial view for every level of the main network."""

from collections.abc import Sequence

from torch import Tensor, nn

from scenefw.models.blocks import ConvUnit, UpUnit, depth_to_space, space_to_depth


class ConditionAutoencoder(nn.Module):
    """Encodes the partial TSDF and rebuilds it from a bottleneck (thesis 5.2.3, fig. 5.20).

    Five convolution layers each way. The first works on blocks of 2^3 voxels, so that every 3x3x3
    convolution runs at half the grid's resolution or below. The last gives blocks of 4^3 voxels.

    Args:
        channels: channels of the condition: 1 partial TSDF, 2 also what was observed.
        sizes: side of the five feature maps, voxels.
        widths: channels of the five feature maps.
        bottleneck: size of the code.
    """

    def __init__(
        self, channels: int, sizes: Sequence[int], widths: Sequence[int], bottleneck: int
    ) -> None:
        super().__init__()
        layers = [ConvUnit(channels * 8, widths[0])]
        for i in range(1, 5):
            stride = sizes[i - 1] // sizes[i]
            layers.append(ConvUnit(widths[i - 1], widths[i], stride=stride))
        self.layers = nn.ModuleList(layers)
        self.deepest = (widths[4], *(sizes[4],) * 3)
        flat = widths[4] * sizes[4] ** 3
        self.squeeze = nn.Linear(flat, bottleneck)
        self.expand = nn.Linear(bottleneck, flat)
        ups = [UpUnit(widths[i], widths[i - 1], stride=sizes[i - 1] // sizes[i]) for i in (4, 3, 2)]
        self.rebuild = nn.Sequential(
            *ups, ConvUnit(widths[1], widths[1]), nn.Conv3d(widths[1], 64, 1)
        )

    def encode(self, condition: Tensor) -> tuple[list[Tensor], Tensor]:
        """Six maps, finest first, and the code (B, bottleneck) of (B, C, X, Y, Z).

        The first map is the condition itself, blocks of 2^3 voxels as channels; features follow.
        """
        features = space_to_depth(condition, 2)
        maps = [features]
        for layer in self.layers:
            features = layer(features)
            maps.append(features)
        return maps, self.squeeze(features.flatten(1))

    def decode(self, code: Tensor) -> Tensor:
        """The partial TSDF (B, 1, X, Y, Z) of codes."""
        features = self.expand(code).reshape(-1, *self.deepest)
        return depth_to_space(self.rebuild(features), 4)
