"""Which frames a network labels: every n-th, or those that show enough that is new."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from scenefw.core import geometry
from scenefw.core.errors import ConfigError

if TYPE_CHECKING:
    from scenefw.core.types import Frame

_STRIDE = 8  # pixels: overlap is counted on a coarse grid


class RunningKeyFrames(Protocol):
    """Decides frame by frame."""

    def takes(self, frame: Frame) -> bool:
        """Whether the next frame is a key frame."""


class KeyFrames(Protocol):
    """A schedule of key frames (group `key_frames`)."""

    def begin(self) -> RunningKeyFrames:
        """Starts a sequence; its first frame is a key frame."""


class EveryNth:
    """The first frame and every n-th after it.

    Args:
        n: 1 takes all frames.
    """

    def __init__(self, n: int = 1) -> None:
        if n < 1:
            raise ConfigError(f"key frames: n = {n}; expected 1 (all frames) or more")
        self.n = n

    def begin(self) -> RunningKeyFrames:
        """Starts a sequence."""
        return _Counting(self.n)


class ByMotion:
    """Frames whose camera has moved or turned enough since the last key frame.

    Args:
        distance: between camera positions (m).
        angle: between camera orientations (rad).
    """

    def __init__(self, distance: float = 0.03, angle: float = 0.15) -> None:
        if not (distance >= 0 and angle >= 0):
            raise ConfigError(
                f"key frames: distance = {distance}, angle = {angle}; expected metres and radians, "
                "0 or more"
            )
        self.distance = distance
        self.angle = angle

    def begin(self) -> RunningKeyFrames:
        """Starts a sequence."""
        return _Moving(self)


class ByOverlap:
    """Frames of whose points the last key frame sees less than a share.

    Occlusion is not looked at: a point counts as seen if it projects into the image.

    Args:
        overlap: least share in [0, 1] of points in view that makes a frame superfluous.
    """

    def __init__(self, overlap: float = 0.8) -> None:
        if not 0 <= overlap <= 1:
            raise ConfigError(f"key frames: overlap = {overlap}; expected a share from 0 to 1")
        self.overlap = overlap

    def begin(self) -> RunningKeyFrames:
        """Starts a sequence."""
        return _Overlapping(self.overlap)


class _Counting:
    def __init__(self, n: int) -> None:
        self.n = n
        self.count = 0

    def takes(self, frame: Frame) -> bool:
        self.count += 1
        return (self.count - 1) % self.n == 0


class _Moving:
    def __init__(self, limits: ByMotion) -> None:
        self.limits = limits
        self.last: Frame | None = None

    def takes(self, frame: Frame) -> bool:
        if self.last is not None:
            step = geometry.inverse(self.last.camera.T_world_camera) @ frame.camera.T_world_camera
            moved = float(np.linalg.norm(step[:3, 3]))
            turned = float(np.arccos(np.clip((np.trace(step[:3, :3]) - 1) / 2, -1, 1)))
            if moved < self.limits.distance and turned < self.limits.angle:
                return False
        self.last = frame
        return True


class _Overlapping:
    def __init__(self, overlap: float) -> None:
        self.overlap = overlap
        self.last: Frame | None = None

    def takes(self, frame: Frame) -> bool:
        if self.last is not None and shared_view(frame, self.last) >= self.overlap:
            return False
        self.last = frame
        return True


def shared_view(frame: Frame, other: Frame) -> float:
    """Share in [0, 1] of a frame's measured points that project into another frame's image."""
    camera = frame.camera
    rows, columns = np.nonzero(frame.depth[::_STRIDE, ::_STRIDE] > 0)
    if not len(rows):
        return 1.0  # nothing seen is nothing new
    v, u = rows * _STRIDE, columns * _STRIDE
    depth = frame.depth[v, u].astype(np.float64)
    x, y = (u - camera.cx) / camera.fx * depth, (v - camera.cy) / camera.fy * depth
    motion = geometry.inverse(other.camera.T_world_camera) @ camera.T_world_camera
    points = geometry.transform_points(motion, np.stack([x, y, depth], axis=-1))
    z = np.where(points[:, 2] > 0, points[:, 2], np.nan)
    across = points[:, 0] / z * other.camera.fx + other.camera.cx
    down = points[:, 1] / z * other.camera.fy + other.camera.cy
    inside = (across > -0.5) & (across < other.camera.width - 0.5)
    inside &= (down > -0.5) & (down < other.camera.height - 0.5)
    return float(inside.mean())
