"""What rises above the floor and is no object: an arm must not hit it, and nobody grasps it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Float64

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
        self, depth: Float32, points: Float64, raised: Mask, floor: Mask, eye: Float64
    ) -> list[ObstacleRegion]:
        """Obstacles, which share no pixel.

        Args:
            depth: (H, W) metres, 0 = no measurement.
            points: (H, W, 3) of the pixels, floor z = 0 (m), NaN = no depth.
            raised: (H, W) pixels of what rises above the floor.
            floor: (H, W) pixels of the floor.
            eye: (3,) where the camera is (m).
        """


def union(regions: Sequence[ObstacleRegion], shape: tuple[int, ...]) -> Mask:
    """Pixels (H, W) of all regions."""
    pixels = np.zeros(shape, dtype=bool)
    for region in regions:
        pixels |= region.pixels
    return pixels
