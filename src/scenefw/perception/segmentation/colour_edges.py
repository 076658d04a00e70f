"""Where objects end in the colour image, near their ends in depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import distance_transform_edt, find_objects, gaussian_filter
from skimage.color import rgb2lab
from skimage.filters import sobel
from skimage.segmentation import watershed

from scenefw.core.settings import COUNT, at_least
from scenefw.perception.observation.pixels import WIDTH
from scenefw.perception.observation.points import MAJORITY
from scenefw.perception.segmentation.ramp_width import ramp_width

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Int32
    from scenefw.perception.observation.observation import Observation


@dataclass(frozen=True, eq=False)
class ColourEdges:
    """Moves ends of parts to edges of the colour image, by a watershed (Meyer 1994).

    A stereo camera finds ends of objects only to within the window that it matches; its colour
    image has them to a pixel. Pixels well inside a part stay its own, those well outside of all
    parts stay outside. The band between is flooded from both along the gradient of colour in Lab,
    so regions meet on its ridges. Where colour has no edge, they meet in the middle of the band.

    The band is as wide as ramps of depth are (`ramp_width`). Images without ramps, of cameras that
    match no windows, and those without colour stay as they are.

    Args:
        min_width: pixels from an edge to the end of its ramp, at least.
        max_width: the same, at most; both of an image 640 wide.

    Raises:
        ConfigError: a share that isn't in 0..1 or is 1, less than one pixel,
            or a narrowest ramp that is wider than the widest.
    """

    min_width: float = 2.0
    max_width: float = 12.0

    def __post_init__(self) -> None:
        COUNT.require(min_width=self.min_width, max_width=self.max_width)
        at_least(self.min_width).require(max_width=self.max_width)

    def moved(self, parts: Int32, view: Observation) -> Int32:
        """Parts (H, W) of a depth image; pixels without depth show none."""
        if view.colour is None or not parts.any() or not view.noise.is_correlated:
            return parts
        scale = view.depth.shape[1] / WIDTH
        distance = distance_transform_edt(parts == 0)
        width = ramp_width(view.heights, distance, round(self.max_width * scale))
        if width < self.min_width * scale:
            return parts
        refined = self.refined(parts, view.colour, width)
        return np.where(view.depth > 0, refined, 0).astype(np.int32)

    def refined(self, parts: Int32, colour: NDArray[np.uint8], width: int) -> Int32:
        """Parts (H, W), 0 = none, with the same numbers.

        Args:
            parts: (H, W), 0 = none.
            colour: (H, W, 3) RGB, aligned with them.
            width: pixels to each side of an end of a part within which it may move.
        """
        outside = int(parts.max(initial=0)) + 1
        cores = np.where(distance_transform_edt(parts == 0) > width, outside, 0)
        for label, box in enumerate(find_objects(parts), start=1):
            if box is not None:
                window = _padded_box(box)
                part_mask = parts[window] == label
                depths = distance_transform_edt(part_mask)
                cores[window][part_mask & (depths > min(width, MAJORITY * depths.max()))] = label
        labels = watershed(colour_gradient(colour), cores)
        return np.where(labels == outside, 0, labels).astype(np.int32)


def colour_gradient(colour: NDArray[np.uint8]) -> Float64:
    """How much colour (H, W, 3; RGB) changes at each pixel (H, W): the gradient in Lab.

    The image is smoothed before, by a pixel of an image 640 wide.
    """
    sigma = colour.shape[1] / WIDTH
    channels = np.moveaxis(rgb2lab(colour), -1, 0)
    gradients = [sobel(gaussian_filter(channel, sigma)) for channel in channels]
    return np.asarray(np.linalg.norm(gradients, axis=0))


def _padded_box(box: tuple[slice, ...]) -> tuple[slice, ...]:
    """A box with a pixel more on each side."""
    return tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in box)
