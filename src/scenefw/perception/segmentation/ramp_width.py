"""How wide ramps of depth are that a stereo camera makes of edges."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.perception.observation.components import NOISE

if TYPE_CHECKING:
    from scenefw.core.types import Float64

_MIN_RISE_SHARE = 0.15  # of the height right beside objects: there a ramp ends
_TYPICAL_QUANTILE = 0.7  # quantile of heights: beside lower edges of objects there is no ramp


def ramp_width(heights: Float64, distances: Float64, max_width: int) -> int:
    """Pixels beside objects, 0 to `max_width`, over which the floor seems to rise.

    Args:
        heights: (H, W) of pixels (m), NaN = no depth.
        distances: (H, W) pixels from the nearest object, 0 on objects.
        max_width: at most.
    """
    floor = (distances > 0) & np.isfinite(heights)
    ring = np.where(floor, np.rint(distances), 0).astype(int)
    far_heights = heights[(ring > max_width + 2) & (ring < 2 * max_width)]
    if not len(far_heights):
        return 0
    floor_height, min_rise = np.quantile(far_heights, _TYPICAL_QUANTILE), NOISE
    for distance in range(1, max_width + 1):
        ring_heights = heights[ring == distance]
        rise = (
            np.quantile(ring_heights, _TYPICAL_QUANTILE) - floor_height
            if len(ring_heights)
            else 0.0
        )
        if rise <= min_rise:
            return distance - 1
        min_rise = max(min_rise, _MIN_RISE_SHARE * rise)
    return max_width
