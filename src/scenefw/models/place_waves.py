"""Places as numbers that networks tell apart."""

import torch
from torch import Tensor

WAVES = 5
"""Octaves, the longest 1 m."""


def place_waves(places: Tensor) -> Tensor:
    """Numbers (..., 3 + 6 WAVES) of places (..., 3) m: themselves, and sines and cosines."""
    waves = 2 * torch.pi * 2.0 ** torch.arange(WAVES, device=places.device)
    angles = (places[..., None] * waves).flatten(-2)
    return torch.cat([4 * places, angles.sin(), angles.cos()], dim=-1)
