"""What a depth image alone separates: parts between jumps of depth and concave creases."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.perception.depth_parts import concave_creases, depth_parts, grown, large_parts
from scenefw.perception.points import world_points

if TYPE_CHECKING:
    from scenefw.core.types import Frame, Int32

_WIDTH = 640  # pixels of the image that the numbers of pixels are for


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
    ) -> None:
        if not (margin >= 0 and jump > 0 and crease > 0 and reach > 0 and smallest > 0):
            raise ConfigError(
                f"seen parts have margin {margin}, jump {jump}, crease {crease}, reach {reach} and "
                f"smallest {smallest}; expected a margin of at least 0 and the others positive"
            )
        self.margin, self.jump, self.crease = margin, jump, crease
        self.reach, self.smallest = reach, smallest

    def with_margin(self, margin: float) -> Self:
        """The same at another margin (m)."""
        return type(self)(margin, self.jump, self.crease, self.reach, self.smallest)

    def segment(self, frame: Frame) -> Int32:
        """Parts (H, W), 0 = none, of a frame whose camera has its pose (floor z = 0)."""
        scale = frame.depth.shape[1] / _WIDTH
        above = world_points(frame)[..., 2] > self.margin  # NaN where no depth: not above
        reach = max(1, round(self.reach * scale))
        smooth = above & ~concave_creases(frame, float(np.cos(np.radians(self.crease))), reach)
        smallest = max(1, round(self.smallest * scale**2))
        parts = large_parts(depth_parts(frame.depth, smooth, self.jump), smallest)
        return grown(parts, above, frame.depth)
