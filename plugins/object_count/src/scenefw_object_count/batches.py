"""What data, network, loss and training of this task hand to each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class CountBatch:
    """B views of scenes.

    Args:
        condition: (B, 2, X, Y, Z): partial TSDF in units of the truncation, in [-1, 1], and 1 where
            observed, else 0.
        counts: (B,) int64, objects in each scene, 1 or more.
    """

    condition: Tensor
    counts: Tensor


@dataclass(frozen=True)
class CountSetup:
    """What losses may know of a training before it starts.

    Args:
        most: largest number of objects that the network knows.
    """

    most: int
