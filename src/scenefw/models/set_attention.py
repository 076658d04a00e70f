"""Attention among the objects of a set, and times of flows as numbers."""

import math

import torch
from torch import Tensor, nn


def time_waves(time: Tensor, width: int) -> Tensor:
    """Sines and cosines (B, width) of times (B,) from 0 to 1."""
    rates = torch.exp(torch.linspace(0, math.log(100.0), width // 2, device=time.device))
    angles = time[:, None] * rates * torch.pi
    return torch.cat([angles.sin(), angles.cos()], dim=-1)


def attention(width: int, layers: int, heads: int) -> nn.TransformerEncoder:
    """Layers of attention without an order among tokens (B, N, width)."""
    layer = nn.TransformerEncoderLayer(
        width, heads, 3 * width, dropout=0.0, activation="gelu", batch_first=True, norm_first=True
    )
    return nn.TransformerEncoder(
        layer, layers, norm=nn.LayerNorm(width), enable_nested_tensor=False
    )
