"""What colour says about whether two regions of an image are one object."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter

from scenefw.core.settings import NOT_NEGATIVE
from scenefw.perception.colour_edges import colour_gradient
from scenefw.perception.pixels import WIDTH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Int32


_MOST = 2.0  # of the strength of edges around objects


class BorderColours:
    """Raises probabilities of one object along borders where colour has no edge, or lowers them.

    A border between two objects is mostly one of colour, too; where one object has been cut, colour
    often goes on. How strong an edge is, is measured by those around regions that border on no
    object. One `neutral` times as strong changes nothing, one weaker or stronger by 1 adds or takes
    away `weight`; all above twice as strong count as that. Borders in depth lie some pixels off, so
    the strongest edge within `reach` counts.

    Real things are more often of several pieces than simulated ones, from which the network has its
    probabilities. So `neutral` is above 1: an edge as strong as those around objects still joins.

    Args:
        weight: of probability.
        neutral: strength of an edge that changes nothing, in that of edges around objects.
        reach: pixels of an image 640 wide.
        smoothing: standard deviation of the image's smoothing, in the same pixels.

    Raises:
        ConfigError: a negative number.
    """

    def __init__(
        self,
        weight: float = 0.4,
        neutral: float = 1.75,
        reach: float = 3.0,
        smoothing: float = 1.0,
    ) -> None:
        NOT_NEGATIVE.require(weight=weight, neutral=neutral, reach=reach, smoothing=smoothing)
        self.weight, self.neutral = weight, neutral
        self.reach, self.smoothing = reach, smoothing

    def added(
        self, regions: Int32, colour: NDArray[np.uint8], step: int
    ) -> tuple[Float32, Float32]:
        """What is added to the right (H, W - 1) and the lower (H - 1, W) neighbour's probability.

        Args:
            regions: (H, W), 0 = none, of a thinned image.
            colour: RGB uint8 of the whole image, aligned with the depth.
            step: of the pixels of that image, every so many-th is in the thinned one.
        """
        edges = colour_gradient(colour, self.smoothing)
        width = 2 * round(self.reach * colour.shape[1] / WIDTH) + 1
        strong = maximum_filter(edges, width)[::step, ::step]
        outer = (regions[:, 1:] > 0) != (regions[:, :-1] > 0)
        pairs = (strong[:, 1:], strong[:, :-1]), (strong[1:], strong[:-1])
        if not outer.any():
            return np.zeros(pairs[0][0].shape, np.float32), np.zeros(pairs[1][0].shape, np.float32)
        usual = max(float(np.median(np.maximum(*pairs[0])[outer])), np.finfo(np.float32).eps)
        across, down = (
            (self.weight * (self.neutral - np.minimum((a + b) / 2 / usual, _MOST))).astype(
                np.float32
            )
            for a, b in pairs
        )
        return across, down
