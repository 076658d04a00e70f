"""Places as numbers that networks tell apart (Tancik et al. 2020)."""

import torch
from torch import Tensor

WAVES = 5
"""Octaves, the longest 1 m."""
_LENGTH = 0.25  # m, in units of which places stand beside their waves


def fourier_features(places: Tensor) -> Tensor:
    """Numbers (..., 3 + 6 WAVES) of places (..., 3) m: in units of 25 cm, and waves of them."""
    waves = 2 * torch.pi * 2.0 ** torch.arange(WAVES, device=places.device)
    angles = (places[..., None] * waves).flatten(-2)
    return torch.cat([places / _LENGTH, angles.sin(), angles.cos()], dim=-1)
