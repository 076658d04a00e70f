"""The noise from which flows start."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor


def start_noise(
    shape: tuple[int, ...], generator: torch.Generator, spread: Sequence[float] | None = None
) -> Tensor:
    """Normal noise (S, ...) on the CPU.

    Args:
        shape: of the noise; draws come first.
        generator: on the CPU.
        spread: (S,) standard deviation of each draw; None: 1.
    """
    noise = torch.randn(shape, generator=generator)
    if spread is None:
        return noise
    return noise * torch.tensor(list(spread)).view(-1, *[1] * (len(shape) - 1))
