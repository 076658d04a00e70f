"""Scene encoder: from the complete volumes to the latent code (training only)."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn

from scenefw.models.blocks import ConvUnit, ResidualBlock


class SceneEncoder(nn.Module):
    """Two layers per modality, five joint SE-residual levels, one linear layer (fig. 5.20).

    Args:
        sizes: side of the five joint levels, finest first; the first is a quarter of the grid's.
        widths: channels of the five joint levels.
        condition_widths: channels of the condition's feature maps of those sizes.
        stem: channels of each modality's layers.
        latent_size: size of the code.
        inputs: channels of each volume by name; None: tsdf 1, votes 3.
    """

    def __init__(
        self,
        sizes: Sequence[int],
        widths: Sequence[int],
        condition_widths: Sequence[int],
        stem: int,
        latent_size: int,
        inputs: Mapping[str, int] | None = None,
    ) -> None:
        super().__init__()
        self.inputs = dict(inputs or {"tsdf": 1, "votes": 3})
        self.others = nn.ModuleDict()
        for name, channels in self.inputs.items():
            if name == "tsdf":
                self.tsdf = _stem(channels, stem)
            elif name == "votes":
                self.votes = _stem(channels, stem)
            else:
                self.others[name] = _stem(channels, stem)
        before = [len(self.inputs) * stem, *widths[:-1]]
        above = [sizes[0], *sizes[:-1]]
        self.levels = nn.ModuleList()
        for i, size in enumerate(sizes):
            stride = above[i] // size
            down = ConvUnit(before[i], widths[i], stride=stride, kernel=3 if stride > 1 else 1)
            merge = ConvUnit(widths[i] + condition_widths[i], widths[i], kernel=1)
            self.levels.append(nn.ModuleList([down, merge, ResidualBlock(widths[i])]))
        self.code = nn.Linear(widths[-1] * sizes[-1] ** 3, 2 * latent_size)

    def forward(
        self, volumes: Mapping[str, Tensor], maps: Sequence[Tensor]
    ) -> tuple[Tensor, Tensor]:
        """Mean and log-variance (B, latent_size) of the posterior.

        Args:
            volumes: complete scenes (B, C, X, Y, Z) by name, in units of the network.
            maps: the condition's feature maps at the sizes of the joint levels.
        """
        features = torch.cat([self._stem(name)(volumes[name]) for name in self.inputs], dim=1)
        for (down, merge, block), condition in zip(self.levels, maps, strict=True):
            features = block(merge(torch.cat([down(features), condition], dim=1)))
        mean, log_variance = self.code(features.flatten(1)).chunk(2, dim=1)
        return mean, log_variance.clamp(-10.0, 4.0)

    def _stem(self, name: str) -> nn.Module:
        if name == "tsdf":
            return self.tsdf
        return self.votes if name == "votes" else self.others[name]


def _stem(channels: int, width: int) -> nn.Sequential:
    """Two layers of one modality: blocks of 4^3 voxels become features, which see each other."""
    return nn.Sequential(
        ConvUnit(channels, width, stride=4, kernel=4, padding=0), ConvUnit(width, width)
    )
