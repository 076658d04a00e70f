"""What a depth image alone separates: parts between jumps of depth and concave creases."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np

from scenefw.core.settings import NOT_NEGATIVE, POSITIVE
from scenefw.perception.observation.pixels import WIDTH
from scenefw.perception.segmentation.regions import concave_creases, depth_parts, grown, large_parts

if TYPE_CHECKING:
    from scenefw.core.types import Float64, Int32
    from scenefw.perception.observation.observation import Observation

_TOP_QUANTILE = 0.95  # share of a part below its top, against single pixels


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

    def segment(self, view: Observation) -> Int32:
        """Parts (H, W), 0 = none, of a depth image."""
        frame, heights = view.frame, view.heights
        scale = frame.depth.shape[1] / WIDTH
        above = heights > self.margin  # NaN where no depth: not above
        reach = max(1, round(self.reach * scale))
        smooth_mask = above & ~concave_creases(frame, float(np.cos(np.radians(self.crease))), reach)
        min_pixels = max(1, round(self.smallest * scale**2))
        parts = large_parts(depth_parts(frame.depth, smooth_mask, self.jump), min_pixels)
        if self.grow:
            parts = grown(parts, above, frame.depth)
        return high_parts(parts, heights, self.lowest)


def high_parts(parts: Int32, heights: Float64, min_height: float | Float64) -> Int32:
    """Parts (H, W) that rise above `min_height` (m, of all pixels or each), numbered from 1 on."""
    clearance = heights - min_height
    tops = [
        np.quantile(clearance[parts == k], _TOP_QUANTILE)
        for k in range(1, parts.max(initial=0) + 1)
    ]
    keep_mask = np.array([False, *(top > 0 for top in tops)])
    return (np.cumsum(keep_mask) * keep_mask)[parts].astype(np.int32)
