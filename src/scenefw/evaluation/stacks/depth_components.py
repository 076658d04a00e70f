"""The baseline without learning: everything above the floor, cut at depth jumps."""

from typing import Self

from scenefw.core.types import Frame, Int32
from scenefw.perception.depth_parts import depth_parts, large_parts
from scenefw.perception.points import world_points


class DepthComponents:
    """Segments a depth image by removing the floor and joining neighbours of similar depth.

    Args:
        margin: pixels up to this height above the floor belong to it (m).
        jump: neighbouring pixels further apart in depth belong to different objects (m).
        smallest: components of fewer pixels are dropped.
    """

    def __init__(self, margin: float = 0.005, jump: float = 0.012, smallest: int = 500) -> None:
        self.margin = margin
        self.jump = jump
        self.smallest = smallest

    def with_margin(self, margin: float) -> Self:
        """The same at another margin (m)."""
        return type(self)(margin, self.jump, self.smallest)

    def segment(self, frame: Frame) -> Int32:
        """Labels (H, W), 0 = no object, of a frame whose camera has its pose (floor z = 0)."""
        above = world_points(frame)[..., 2] > self.margin  # NaN where no depth: not above
        return large_parts(depth_parts(frame.depth, above, self.jump), self.smallest)
