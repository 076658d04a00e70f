"""How wide ramps of depth are that a stereo camera makes of edges."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scenefw.core.types import Float64

LEAST = 0.002
"""Height (m) from which on the floor seems to rise."""
_SHARE = 0.15  # of the height right beside objects: there a ramp ends
_TYPICAL = 0.7  # quantile of heights: beside lower edges of objects there is no ramp


def ramp_width(heights: Float64, away: Float64, widest: int) -> int:
    """Pixels beside objects, 0 to `widest`, over which the floor seems to rise.

    Args:
        heights: (H, W) of pixels (m), NaN = no depth.
        away: (H, W) pixels from the nearest object, 0 on objects.
        widest: at most.
    """
    floor = (away > 0) & np.isfinite(heights)
    ring = np.where(floor, np.rint(away), 0).astype(int)
    far = heights[(ring > widest + 2) & (ring < 2 * widest)]
    if not len(far):
        return 0
    usual, least = np.quantile(far, _TYPICAL), LEAST
    for distance in range(1, widest + 1):
        own = heights[ring == distance]
        rise = np.quantile(own, _TYPICAL) - usual if len(own) else 0.0
        if rise <= least:
            return distance - 1
        least = max(least, _SHARE * rise)
    return widest
