"""What colour says about whether two regions of an image are one object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter

from scenefw.core.settings import NOT_NEGATIVE
from scenefw.perception.observation.pixels import WIDTH
from scenefw.perception.segmentation.colour_edges import colour_gradient

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Int32


_MAX_STRENGTH = 2.0  # of the strength of edges around objects
_MIN_EDGE_STRENGTH = 3.0  # of Lab a pixel: edges around objects of real images have 7 to 24


@dataclass(frozen=True, eq=False)
class BorderColours:
    """Raises probabilities of one object along borders where colour has no edge, or lowers them.

    A border between two objects is mostly one of colour, too; where one object has been cut, colour
    often goes on. The strength of an edge is that of its gradient, divided by that of edges around
    all regions. A strength of `neutral` changes nothing. A weaker edge adds `weight` times the
    difference, but at most `weight`, so colour alone joins nothing; a stronger one takes away as
    much, up to twice the strength of edges around regions. Borders in depth lie some pixels off, so
    the strongest edge within `reach` counts. In images without edges, as those of one colour are,
    nothing changes.

    Real things are more often of several pieces than simulated ones, from which the network has its
    probabilities. So `neutral` is above 1: an edge as strong as those around objects still joins.

    Args:
        weight: of probability.
        neutral: strength of an edge that changes nothing, in that of edges around objects.
        reach: pixels of an image 640 wide.

    Raises:
        ConfigError: a negative number.
    """

    weight: float = 0.4
    neutral: float = 1.75
    reach: float = 3.0

    def __post_init__(self) -> None:
        NOT_NEGATIVE.require(weight=self.weight, neutral=self.neutral, reach=self.reach)

    def added(
        self, regions: Int32, colour: NDArray[np.uint8], step: int
    ) -> tuple[Float32, Float32]:
        """What is added to the right (H, W - 1) and the lower (H - 1, W) neighbour's probability.

        Args:
            regions: (H, W), 0 = none, of a thinned image.
            colour: RGB uint8 (H * step, W * step, 3) or a little smaller: the whole image, aligned
                with the depth.
            step: of the rows and columns of that image, every so many-th is in the thinned one.
        """
        edges = colour_gradient(colour)
        width = 2 * round(self.reach * colour.shape[1] / WIDTH) + 1
        strengths = maximum_filter(edges, width)[::step, ::step].astype(np.float32)
        pairs = (strengths[:, 1:], strengths[:, :-1]), (strengths[1:], strengths[:-1])
        objects = regions > 0
        ends = objects[:, 1:] != objects[:, :-1], objects[1:] != objects[:-1]
        border_strengths = [np.maximum(*pair)[end] for pair, end in zip(pairs, ends, strict=True)]
        typical_strength = (
            float(np.median(np.concatenate(border_strengths)))
            if any(map(len, border_strengths))
            else 0.0
        )
        if typical_strength < _MIN_EDGE_STRENGTH:
            return np.zeros_like(pairs[0][0]), np.zeros_like(pairs[1][0])
        across, down = (
            self._probability_change((a + b) / (2 * typical_strength)) for a, b in pairs
        )
        return across, down

    def _probability_change(self, strength: Float32) -> Float32:
        change = self.weight * np.minimum(self.neutral - np.minimum(strength, _MAX_STRENGTH), 1.0)
        return np.asarray(change, dtype=np.float32)
