"""Scene encoder: from the complete shape and votes to the latent code (training only)."""

from collections.abc import Sequence

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
    """

    def __init__(
        self,
        sizes: Sequence[int],
        widths: Sequence[int],
        condition_widths: Sequence[int],
        stem: int,
        latent_size: int,
    ) -> None:
        super().__init__()
        self.tsdf = _stem(1, stem)
        self.votes = _stem(3, stem)
        before = [2 * stem, *widths[:-1]]
        above = [sizes[0], *sizes[:-1]]
        self.levels = nn.ModuleList()
        for i, size in enumerate(sizes):
            stride = above[i] // size
            down = ConvUnit(before[i], widths[i], stride=stride, kernel=3 if stride > 1 else 1)
            merge = ConvUnit(widths[i] + condition_widths[i], widths[i], kernel=1)
            self.levels.append(nn.ModuleList([down, merge, ResidualBlock(widths[i])]))
        self.code = nn.Linear(widths[-1] * sizes[-1] ** 3, 2 * latent_size)

    def forward(self, tsdf: Tensor, votes: Tensor, maps: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """Mean and log-variance (B, latent_size) of the posterior.

        Args:
            tsdf: (B, 1, X, Y, Z) in units of the truncation.
            votes: (B, 3, X, Y, Z).
            maps: the condition's feature maps at the sizes of the joint levels.
        """
        features = torch.cat([self.tsdf(tsdf), self.votes(votes)], dim=1)
        for (down, merge, block), condition in zip(self.levels, maps, strict=True):
            features = block(merge(torch.cat([down(features), condition], dim=1)))
        mean, log_variance = self.code(features.flatten(1)).chunk(2, dim=1)
        return mean, log_variance.clamp(-10.0, 4.0)


def _stem(channels: int, width: int) -> nn.Sequential:
    """Two layers of one modality: blocks of 4^3 voxels become features, which see each other."""
    return nn.Sequential(
        ConvUnit(channels, width, stride=4, kernel=4, padding=0), ConvUnit(width, width)
    )
