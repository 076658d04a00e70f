"""Attention that knows where what is attended to lies, as seen from each query."""

import torch
from torch import Tensor, nn

_RELATIVE = 32


class RelativeAttention(nn.Module):
    """Attention whose weights and values also depend on the offset of each token from each query.

    A shape is told by places about its middle; with absolute places alone, differences of a few
    centimetres drown. Offsets become features; each head adds a number of them to its weights, and
    their weighted mean to its values.

    Args:
        width: channels of queries and tokens.
        heads: of attention; they share the channels.
        offset: numbers of an offset.
    """

    def __init__(self, width: int, heads: int, offset: int) -> None:
        super().__init__()
        self.heads = heads
        self.query, self.key = nn.Linear(width, width), nn.Linear(width, width)
        self.value, self.out = nn.Linear(width, width), nn.Linear(width, width)
        self.offset = nn.Sequential(
            nn.Linear(offset, _RELATIVE), nn.GELU(), nn.Linear(_RELATIVE, _RELATIVE)
        )
        self.bias = nn.Linear(_RELATIVE, heads)
        self.placed = nn.Linear(heads * _RELATIVE, width)

    def forward(self, queries: Tensor, tokens: Tensor, offsets: Tensor, counted: Tensor) -> Tensor:
        """What each query gathers (B, N, width).

        Args:
            queries: (B, N, width).
            tokens: (B, T, width).
            offsets: (B, N, T, offset).
            counted: (B, T) bool: tokens that count; one at least for each of B.
        """
        q, k, v = (
            layer(values).unflatten(-1, (self.heads, -1)).transpose(1, 2)
            for layer, values in (
                (self.query, queries), (self.key, tokens), (self.value, tokens)
            )
        )  # fmt: skip
        relative = self.offset(offsets)
        logits = q @ k.transpose(-1, -2) / k.shape[-1] ** 0.5
        logits = logits + self.bias(relative).permute(0, 3, 1, 2)
        logits = logits.masked_fill(~counted[:, None, None], -torch.inf)
        weights = logits.softmax(dim=-1)
        placed = weights.transpose(1, 2) @ relative  # (B, N, heads, relative)
        context = (weights @ v).transpose(1, 2).flatten(2)
        output: Tensor = self.out(context + self.placed(placed.flatten(2)))
        return output
