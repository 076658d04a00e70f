"""Things too low to be told from a floor by one threshold, such as pens and phones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from scenefw.fitting.placed import OUTLIERS
from scenefw.perception.observation.floor_noise import MAX_FLOOR_HEIGHT
from scenefw.perception.observation.pixels import BLUR, min_area, scaled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64

    Mask = NDArray[np.bool_]


def flat_things(heights: Float64, deviations: Float64, floor_margin: float) -> list[Mask]:
    """Pixels (H, W) of each thing no higher than a floor may seem, the largest first.

    What goes on into something higher isn't one: the foot of a bowl, the bottom of a box.

    Args:
        heights: (H, W) metres above the floor, NaN = no depth.
        deviations: (H, W) standard deviations of the floor's heights (m).
        floor_margin: no thing is as low (m): tables are no flatter, and not all in one piece.
    """
    window = scaled(BLUR, heights.shape[1])
    raised = ndimage.binary_fill_holes(~(heights < MAX_FLOOR_HEIGHT))  # also where no depth is
    raised = ndimage.binary_dilation(raised, iterations=2 * window)
    mean = ndimage.uniform_filter(np.where(raised, 0.0, heights), 2 * window + 1)
    flat = (mean > np.maximum(OUTLIERS * deviations, floor_margin)) & ~raised
    labels, _ = ndimage.label(ndimage.binary_opening(flat, iterations=window))
    beside = np.unique(labels[ndimage.binary_dilation(raised, iterations=window)])
    sizes = np.bincount(labels.ravel())
    sizes[beside] = sizes[0] = 0
    large = np.flatnonzero(sizes >= min_area(heights.shape[1]))
    return [labels == label for label in large[np.argsort(-sizes[large])]]
