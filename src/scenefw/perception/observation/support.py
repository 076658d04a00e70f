"""Which of the things that rise above a floor stand on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage
from skimage.morphology import convex_hull_image

from scenefw.perception.observation.components import EDGE, depth_parts
from scenefw.perception.observation.points import MAJORITY, MINORITY
from scenefw.perception.observation.raster import GAP, FloorRaster

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Float64

    Mask = NDArray[np.bool_]

_RASTER = FloorRaster()


def standing_pixels(
    depth: Float32, points: Float64, raised: Mask, min_height: float | Float64, min_pixels: float
) -> Mask:
    """Pixels (H, W) of things that stand on the floor z = 0, or on what stands there.

    The floor that is seen hides beneath things and goes on behind them. So a thing stands whose
    lowest points lie beside the floor or beside another one that stands; what is seen of the floor
    beside it belongs to it then, too. So do things over the hull of all these. What goes on below
    the floor stands on something lower.

    Args:
        depth: (H, W) metres.
        points: (H, W, 3) of the pixels (m), NaN = no depth.
        raised: (H, W) pixels of what may be things.
        min_height: what is lower is the floor (m), of all pixels or each.
        min_pixels: of a component that says where the floor goes on.
    """
    height = points[..., 2]
    components = depth_parts(depth, raised, EDGE)
    large = np.bincount(components.ravel()) >= min_pixels
    large[0] = False
    floor = ndimage.binary_closing(
        _RASTER.count(points[np.abs(height) < min_height]) > 0, iterations=GAP
    )
    pieces, _ = ndimage.label(floor)
    region = _pieces_at(pieces, ndimage.binary_erosion(floor, iterations=GAP))
    if not region.any():
        return np.zeros(raised.shape, dtype=bool)
    footprint = _cells_of_components(components, points, raised)
    is_low = raised & (height < EDGE)  # where it may touch its floor
    lower = _cells_of_components(components, points, is_low)
    is_below = _RASTER.count(points[(height < -min_height) & (height > -EDGE)]).ravel() > 0
    reaching = np.bincount(lower[0], is_below[lower[1]], minlength=len(large))
    is_deeper = reaching > MAJORITY * np.bincount(lower[0], minlength=len(large))
    large &= ~is_deeper
    is_hidden = np.bincount(components.ravel(), is_low.ravel()) == 0  # its low part, by another
    base = _cells_of_components(components, points, is_low | (raised & is_hidden[components]))
    stands = np.zeros(len(large), dtype=bool)
    while True:
        rim = ndimage.maximum_filter(region, 2 * GAP + 1)
        size = region.sum()
        stands[base[0][rim.ravel()[base[1]]]] = True
        stands &= large
        region.ravel()[footprint[1][stands[footprint[0]]]] = True
        region |= _pieces_at(pieces, rim)
        if region.sum() == size:
            break
    hull = ndimage.binary_dilation(convex_hull_image(region), iterations=GAP)
    inside = np.bincount(footprint[0], hull.ravel()[footprint[1]], minlength=len(large))
    cells = np.bincount(footprint[0], minlength=len(large))
    stands |= inside > (1 - MINORITY) * cells
    stands &= ~is_deeper
    stands[0] = False
    mask: Mask = stands[components]
    return mask


def _pieces_at(pieces: NDArray[np.int32], mask: Mask) -> Mask:
    """Cells of all pieces of floor that have some in a mask."""
    return np.isin(pieces, np.unique(pieces[mask])) & (pieces > 0)


def _cells_of_components(
    components: NDArray[np.int64], points: Float64, mask: Mask
) -> NDArray[np.int64]:
    """Pairs (2, N) of a component and the number of a cell that pixels of `mask` have of it."""
    cells, size = _RASTER.numbers(points[mask]), _RASTER.side**2
    pairs = np.unique((components[mask] * size + cells)[cells >= 0])  # faster than pairs of numbers
    return np.stack(np.divmod(pairs, size))
