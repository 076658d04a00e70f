"""What a depth image alone separates: parts between jumps of depth and concave creases."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.settings import NOT_NEGATIVE, POSITIVE
from scenefw.perception.observation.components import depth_parts
from scenefw.perception.observation.pixels import WIDTH, scaled
from scenefw.perception.observation.points import STRAYS
from scenefw.perception.segmentation.regions import concave_creases, grown, large_parts

if TYPE_CHECKING:
    from scenefw.core.types import Float64, Int32
    from scenefw.perception.observation.observation import Observation


@dataclass(frozen=True, eq=False)
class CreaseSegmentation:
    """Cuts a depth image above the floor at jumps of depth and at creases; learns nothing.

    No convex object has a concave crease, so two parts that meet in one are two objects. Creases
    are lines some pixels wide; their pixels then join the part that is nearest along the surface.

    Args:
        floor_margin: points up to this height above the floor belong to it (m).
        max_step: neighbouring pixels further apart in depth belong to different parts (m).
        min_bend: a surface that bends towards the camera by more than this is cut (degrees); 180
            cuts nowhere.
        reach: on either side, between which a bend is measured (pixels of an image 640 wide).
        min_pixels: parts of fewer pixels (of an image 640 wide) are dropped.
        min_height: parts that rise no higher above the floor (m) are noise of it.
        grow: whether pixels of creases join parts; without it they are none's.

    Raises:
        ConfigError: a negative margin, or another number that isn't positive.
    """

    floor_margin: float = 0.005
    max_step: float = 0.012
    min_bend: float = 30.0
    reach: float = 8.0
    min_pixels: float = 500.0
    min_height: float = 0.0
    _: KW_ONLY
    grow: bool = True

    def __post_init__(self) -> None:
        POSITIVE.require(max_step=self.max_step, min_bend=self.min_bend)
        POSITIVE.require(reach=self.reach, min_pixels=self.min_pixels)
        NOT_NEGATIVE.require(floor_margin=self.floor_margin, min_height=self.min_height)

    def segment(self, view: Observation) -> Int32:
        """Parts (H, W), 0 = none, of a depth image."""
        frame, heights = view.frame, view.heights
        scale = frame.depth.shape[1] / WIDTH
        above = heights > self.floor_margin  # NaN where no depth: not above
        reach = scaled(self.reach, frame.depth.shape[1])
        smooth_mask = above & ~concave_creases(
            frame, float(np.cos(np.radians(self.min_bend))), reach
        )
        min_pixels = max(1, round(self.min_pixels * scale**2))
        parts = large_parts(depth_parts(frame.depth, smooth_mask, self.max_step), min_pixels)
        if self.grow:
            parts = grown(parts, above, frame.depth)
        return high_parts(parts, heights, self.min_height)


def high_parts(parts: Int32, heights: Float64, min_height: float | Float64) -> Int32:
    """Parts (H, W) that rise above `min_height` (m, of all pixels or each), numbered from 1 on."""
    clearance = heights - min_height
    tops = [
        np.quantile(clearance[parts == k], 1 - STRAYS) for k in range(1, parts.max(initial=0) + 1)
    ]
    keep_mask = np.array([False, *(top > 0 for top in tops)])
    return (np.cumsum(keep_mask) * keep_mask)[parts].astype(np.int32)
