"""Level surfaces above and below the one that is taken for the table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from scenefw.perception.observation.floor import TABLE_HEIGHT
from scenefw.perception.observation.object_groups import MAX_UNSAID_RATIO
from scenefw.perception.observation.raster import CELL, GAP

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.height_maps import HeightMap
    from scenefw.core.types import Float32, Float64

_MIN_TABLE_AREA = 0.15  # m²: twice that of a keyboard, the largest thing on a table


def lower_level(heights: Float64 | Float32) -> float | None:
    """Where below the table much was measured, as on a second one; None: nowhere.

    Args:
        heights: of all that was measured above the table (m), of any shape, NaN = nothing.

    Returns:
        Metres below the table, at most `TABLE_HEIGHT`; floors of rooms lie lower.
    """
    below = -heights[heights < -GAP * CELL]  # nearer are the table's own bends
    depth = _fullest(below)
    is_wide = np.count_nonzero(_near(below, depth)) >= MAX_UNSAID_RATIO * np.isfinite(heights).sum()
    return depth if depth is not None and is_wide else None


def higher_level(height_map: HeightMap) -> float | None:
    """Height (m) of a level surface above a map's table that is too wide for a thing; or None."""
    heights = height_map.heights
    height = _fullest(heights[heights > GAP * CELL])
    pieces, _ = ndimage.label(_near(heights, height))
    widest = np.bincount(pieces.ravel())[1:].max(initial=0) * height_map.grid.spacing**2
    return height if widest >= _MIN_TABLE_AREA else None


def _fullest(distances: Float64 | Float32) -> float | None:
    """The middle of the level at which most of some distances from the table lie (m)."""
    distances = distances[distances < TABLE_HEIGHT + CELL]
    if not len(distances):
        return None
    level = np.bincount((distances / CELL).astype(int)).argmax()
    return float(np.median(distances[_near(distances, CELL * (level + 0.5))]))


def _near(heights: Float64 | Float32, level: float | None) -> NDArray[np.bool_]:
    return np.abs(heights - (np.nan if level is None else level)) < CELL
