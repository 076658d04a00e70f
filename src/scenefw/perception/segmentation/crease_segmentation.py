"""What a depth image alone separates: parts between jumps of depth and concave creases."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np

from scenefw.core.settings import NOT_NEGATIVE, POSITIVE
from scenefw.perception.observation.pixels import WIDTH
from scenefw.perception.observation.points import world_points
from scenefw.perception.segmentation.regions import concave_creases, depth_parts, grown, large_parts

if TYPE_CHECKING:
    from scenefw.core.types import Float32, Float64, Frame, Int32

_ABOUT = 0.03  # m: depth below the floor that may be its noise
_EXACT = 1e-5  # m: no measurement is as close to the floor, over many pixels
_WAVES, _ALIKE = 0.015, 0.92  # m, of heights of the floor; correlation of neighbours
_FEWEST = 200  # pixels below the floor that say how noisy it is
_SOME = 0.1  # share of the floor's pixels that have noise, if it has
_NORMAL = 1.4826  # from a normal distribution's median deviation to its standard deviation
_TOP = 0.95  # share of a part below its top, against single pixels


class SeenParts:
    """Cuts a depth image above the floor at jumps of depth and at creases; learns nothing.

    No convex object has a concave crease, so two parts that meet in one are two objects. Creases
    are lines some pixels wide; their pixels then join the part that is nearest along the surface.

    Args:
        margin: points up to this height above the floor belong to it (m).
        jump: neighbouring pixels further apart in depth belong to different parts (m).
        crease: a surface that bends towards the camera by more than this is cut (degrees); 180
            cuts nowhere.
        reach: on either side, between which a bend is measured (pixels of an image 640 wide).
        smallest: parts of fewer pixels (of an image 640 wide) are dropped.
        lowest: parts that rise no higher above the floor (m) are noise of it.
        grow: whether pixels of creases join parts; without it they are none's.

    Raises:
        ConfigError: a negative margin, or another number that isn't positive.
    """

    def __init__(
        self,
        margin: float = 0.005,
        jump: float = 0.012,
        crease: float = 30.0,
        reach: float = 8.0,
        smallest: float = 500.0,
        lowest: float = 0.0,
        *,
        grow: bool = True,
    ) -> None:
        POSITIVE.require(jump=jump, crease=crease, reach=reach, smallest=smallest)
        NOT_NEGATIVE.require(margin=margin, lowest=lowest)
        self.margin, self.jump, self.crease = margin, jump, crease
        self.reach, self.smallest, self.lowest, self.grow = reach, smallest, lowest, grow

    def with_margin(self, margin: float) -> Self:
        """The same at another margin (m)."""
        return type(self)(
            margin,
            self.jump,
            self.crease,
            self.reach,
            self.smallest,
            self.lowest,
            grow=self.grow,
        )

    def segment(self, frame: Frame) -> Int32:
        """Parts (H, W), 0 = none, of a frame whose camera has its pose (floor z = 0)."""
        scale = frame.depth.shape[1] / WIDTH
        heights = world_points(frame)[..., 2]
        above = heights > self.margin  # NaN where no depth: not above
        reach = max(1, round(self.reach * scale))
        smooth = above & ~concave_creases(frame, float(np.cos(np.radians(self.crease))), reach)
        smallest = max(1, round(self.smallest * scale**2))
        parts = large_parts(depth_parts(frame.depth, smooth, self.jump), smallest)
        if self.grow:
            parts = grown(parts, above, frame.depth)
        return high_parts(parts, heights, self.lowest)


def high_parts(parts: Int32, heights: Float64, lowest: float | Float64) -> Int32:
    """Parts (H, W) that rise above `lowest` (m, of all pixels or of each), numbered from 1 on."""
    above = heights - lowest
    tops = [np.quantile(above[parts == k], _TOP) for k in range(1, parts.max(initial=0) + 1)]
    kept = np.array([False, *(top > 0 for top in tops)])
    return (np.cumsum(kept) * kept)[parts].astype(np.int32)


def floor_is_smooth(heights: Float64) -> bool:
    """Whether the floor waves: its heights (H, W; m, NaN = no depth) are wrong alike in neighbours.

    So they are where a camera matches windows of two images, and not where each pixel has an error
    of its own. Neighbours of active stereo cameras correlate by 0.95 to 0.99, those of structured
    light by 0.9 at most. Images larger than 640 x 480 are compared that many pixels further apart.
    """
    alike, k = [], max(1, round(heights.shape[1] / WIDTH))
    for first, second in ((heights[k:], heights[:-k]), (heights[:, k:], heights[:, :-k])):
        about = (np.abs(first) < _WAVES) & (np.abs(second) < _WAVES)
        least = max(_FEWEST, _SOME * about.sum())
        about &= (np.abs(first) > _EXACT) & (np.abs(second) > _EXACT)
        if about.sum() < least:
            return False
        alike.append(np.corrcoef(first[about], second[about])[0, 1])
    return bool(np.mean(alike) > _ALIKE)


def floor_noise(heights: Float64, depth: Float32) -> float:
    """Robust standard deviation (m) of the floor's heights at a depth of 1 m; 0 if little is seen.

    It grows with the square of depth, as errors of triangulation do. Only what lies below z = 0
    counts: above it may be objects. What lies on it exactly has been moved there, from beyond the
    table.

    Args:
        heights: (H, W) metres, NaN = no depth.
        depth: (H, W) metres.
    """
    below = (heights < -_EXACT) & (heights > -_ABOUT)
    if below.sum() < _FEWEST:
        return 0.0
    return float(_NORMAL * np.median(-heights[below] / depth[below] ** 2))
