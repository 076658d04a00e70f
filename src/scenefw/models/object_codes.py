"""From a feature volume to one code per object, and from a code to a volume again."""

import torch
from torch import Tensor, nn


def largest_cells(features: Tensor, count: int) -> Tensor:
    """Cells with the largest mean over channels (thesis eq. 6.1), the largest first.

    Args:
        features: (B, C, S, S, S).
        count: cells to take, at most S^3.

    Returns:
        (B, count) int64 positions in the flattened volume; no gradient passes through the choice.
    """
    return cell_means(features).topk(count, dim=1).indices


def cell_means(features: Tensor) -> Tensor:
    """Mean over channels (B, S^3) of features (B, C, S, S, S)."""
    return features.flatten(2).mean(dim=1)


def codes_at(features: Tensor, cells: Tensor) -> Tensor:
    """Feature vectors (B, N, C) of cells (B, N) of features (B, C, S, S, S)."""
    vectors = features.flatten(2).transpose(1, 2)
    return vectors.gather(1, cells[..., None].expand(-1, -1, vectors.shape[2]))


class SpatialBroadcast(nn.Module):
    """Repeats a code in every cell of a volume and says where each is (Watters et al. 2019).

    Args:
        side: cells per side of the volume.
    """

    def __init__(self, side: int) -> None:
        super().__init__()
        axis = (torch.arange(side) + 0.5) * (2 / side) - 1
        places = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"))
        self.register_buffer("places", places[None], persistent=False)

    def forward(self, codes: Tensor) -> Tensor:
        """Volumes (K, C + 3, S, S, S) of codes (K, C); the last channels are x, y and z."""
        places: Tensor = self.get_buffer("places").to(codes.dtype)
        spread = codes[:, :, None, None, None].expand(-1, -1, *places.shape[2:])
        return torch.cat([spread, places.expand(codes.shape[0], -1, -1, -1, -1)], dim=1)


class CodeAttention(nn.Module):
    """Lets the codes of a scene see each other, so that two need not stand for one object.

    One block of self-attention and a layer per code (Vaswani et al. 2017), without positions: the
    order of the codes doesn't matter.

    Args:
        size: of a code.
        heads: of the attention.
    """

    def __init__(self, size: int, heads: int = 4) -> None:
        super().__init__()
        self.norms = nn.ModuleList([nn.LayerNorm(size), nn.LayerNorm(size)])
        self.attention = nn.MultiheadAttention(size, heads, batch_first=True)
        self.layers = nn.Sequential(
            nn.Linear(size, 2 * size), nn.PReLU(), nn.Linear(2 * size, size)
        )

    def forward(self, codes: Tensor) -> Tensor:
        """Codes (B, N, C), refined."""
        inputs = self.norms[0](codes)
        codes = codes + self.attention(inputs, inputs, inputs, need_weights=False)[0]
        refined: Tensor = codes + self.layers(self.norms[1](codes))
        return refined
