"""Scene decoder: from a code and the view's features to complete volumes."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn

from scenefw.models.blocks import Conv3d, ConvUnit, ResidualBlock, UpUnit, depth_to_space

STANDARD = {"tsdf": 1, "votes": 3}
"""Channels of the volumes of a network by default."""

_MAPPED = 3  # the joint level that gets a map of the code


class SceneDecoder(nn.Module):
    """Two linear layers, five joint SE-residual levels, one branch per modality (fig. 5.20).

    Mirrors the encoder. The joint levels end at a quarter of the grid's side. Then a fine layer at
    half of it, which also sees the condition itself, so that what is visible need not be rebuilt
    from features, gives the TSDF as blocks of 2^3 voxels. Votes are smooth within objects: a layer
    at a quarter of the side gives them as blocks of 4^3 voxels, and the fine layer what changes at
    the borders of objects. Any further volume comes from the fine layer, as the TSDF does.

    Args:
        sizes: side of the five joint levels, coarsest first; the last is a quarter of the grid's.
        widths: channels of the five joint levels.
        condition_widths: channels of the condition's maps, coarsest first; the last is that of the
            condition itself.
        branch: channels of the fine layer.
        code_size: size of the latent code and the condition's code together.
        latent_size: size of the latent code, which comes first.
        code_width: channels of a map at the fourth level that the latent code gives directly;
            0 = none.
        outputs: channels of each volume by name; None: tsdf 1, votes 3.
    """

    def __init__(
        self,
        sizes: Sequence[int],
        widths: Sequence[int],
        condition_widths: Sequence[int],
        branch: int,
        code_size: int,
        latent_size: int = 0,
        code_width: int = 0,
        outputs: Mapping[str, int] | None = None,
    ) -> None:
        super().__init__()
        self.outputs = dict(outputs or STANDARD)
        self.coarsest = (widths[0], *(sizes[0],) * 3)
        flat = widths[0] * sizes[0] ** 3
        self.linear = nn.Sequential(
            nn.Linear(code_size, 2 * code_size),
            nn.PReLU(),
            nn.Linear(2 * code_size, flat),
            nn.PReLU(),
        )
        self.first = ResidualBlock(widths[0])
        self.levels = nn.ModuleList()
        for i in range(1, 5):
            up = UpUnit(widths[i - 1], widths[i], stride=sizes[i] // sizes[i - 1])
            merge = ConvUnit(widths[i] + condition_widths[i - 1], widths[i])
            self.levels.append(nn.ModuleList([up, merge, ResidualBlock(widths[i])]))
        self.code_map: _CodeMap | None = None
        if code_width:
            self.code_map = _CodeMap(latent_size, code_width, widths[_MAPPED], sizes[_MAPPED])
        self.fine = _FineLayer(widths[4], condition_widths[4], branch)
        fine = branch + condition_widths[5]
        self.others = nn.ModuleDict()
        if "tsdf" in self.outputs:
            self.tsdf = Conv3d(fine, 8 * self.outputs["tsdf"], 1)
        if "votes" in self.outputs:
            blocks = self.outputs["votes"] * 64
            self.votes = nn.Sequential(ConvUnit(widths[4], widths[4]), Conv3d(widths[4], blocks, 1))
            self.fine_votes = Conv3d(fine, 8 * self.outputs["votes"], 1)
        for name in self.outputs:
            if name not in STANDARD:
                self.others[name] = Conv3d(fine, 8 * self.outputs[name], 1)

    def forward(self, code: Tensor, maps: Sequence[Tensor]) -> dict[str, Tensor]:
        """Volumes (B, C, X, Y, Z) by name, in the order of `outputs`.

        Args:
            code: (B, code_size).
            maps: six maps of the condition, coarsest first.
        """
        features = self._features(code, maps)
        fine = self.fine(features, maps[4], maps[5])
        return {name: self._volume(name, features, fine) for name in self.outputs}

    def _volume(self, name: str, features: Tensor, fine: Tensor) -> Tensor:
        if name == "votes":
            coarse = depth_to_space(self.votes(features), 4)
            return coarse + depth_to_space(self.fine_votes(fine), 2)
        head = self.tsdf if name == "tsdf" else self.others[name]
        return depth_to_space(head(fine), 2)

    def _features(self, code: Tensor, maps: Sequence[Tensor]) -> Tensor:
        features: Tensor = self.first(self.linear(code).reshape(-1, *self.coarsest))
        for i, (up, merge, block) in enumerate(self.levels, start=1):
            features = merge(torch.cat([up(features), maps[i - 1]], dim=1))
            if self.code_map is not None and i == _MAPPED:
                features = features + self.code_map(code)
            features = block(features)
        return features


class _CodeMap(nn.Module):
    """A short way from the latent code to a volume of features.

    What the view leaves open is a matter of where, and five levels dilute the code on their way.
    """

    def __init__(self, latent_size: int, width: int, outputs: int, size: int) -> None:
        super().__init__()
        self.latent_size, self.shape = latent_size, (width, size, size, size)
        self.linear = nn.Linear(latent_size, width * size**3)
        self.spread = Conv3d(width, outputs, 3, padding=1, bias=False)

    def forward(self, code: Tensor) -> Tensor:
        volume: Tensor = self.spread(
            self.linear(code[:, : self.latent_size]).unflatten(1, self.shape)
        )
        return volume


class _FineLayer(nn.Module):
    """One layer at half the grid's side, which sees the condition and its finest features."""

    def __init__(self, inputs: int, condition: int, width: int) -> None:
        super().__init__()
        self.up = nn.ConvTranspose3d(inputs, width, 2, 2, bias=False)
        self.merge = ConvUnit(width + condition, width)

    def forward(self, features: Tensor, condition: Tensor, blocks: Tensor) -> Tensor:
        merged = self.merge(torch.cat([self.up(features), condition], dim=1))
        return torch.cat([merged, blocks.to(merged.dtype)], dim=1)
