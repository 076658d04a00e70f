"""What rises above the floor and is no object: an arm must not hit it, and nobody grasps it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Frame

    Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ObstacleRegion:
    """Pixels that show an obstacle.

    Args:
        kind: what it is taken for, in a word or two.
        pixels: (H, W).
    """

    kind: str
    pixels: Mask


class ObstacleFinding(Protocol):
    """Finds obstacles in a depth image (group `obstacles`)."""

    def find(
        self, frame: Frame, points: Float64, raised: Mask, floor: Mask
    ) -> list[ObstacleRegion]:
        """Obstacles, which share no pixel.

        Args:
            frame: whose floor is z = 0.
            points: (H, W, 3) of the pixels (m), NaN = no depth.
            raised: (H, W) pixels of what rises above the floor.
            floor: (H, W) pixels of the floor.
        """


def union(regions: Sequence[ObstacleRegion], shape: tuple[int, ...]) -> Mask:
    """Pixels (H, W) of all regions."""
    pixels = np.zeros(shape, dtype=bool)
    for region in regions:
        pixels |= region.pixels
    return pixels
