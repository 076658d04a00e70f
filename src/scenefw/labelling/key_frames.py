"""Which frames a network labels: every n-th, or those that show enough new."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.core import geometry
from scenefw.core.settings import COUNT, NOT_NEGATIVE, SHARE
from scenefw.core.types import Camera

if TYPE_CHECKING:
    from collections.abc import Callable

    from scenefw.core.labelling_protocols import RunningKeyFrames, State
    from scenefw.core.types import Frame

_LENS = ("fx", "fy", "cx", "cy", "width", "height")
_STRIDE = 8  # pixels: overlap is counted on a coarse grid


class EveryNth:
    """The first frame and every n-th after it.

    Args:
        n: 1 takes all frames.
    """

    def __init__(self, n: int = 1) -> None:
        COUNT.require(n=n)
        self.n = n

    def begin(self, state: State | None = None) -> RunningKeyFrames:
        """Starts a sequence or resumes one."""
        return _Counting(self.n, state)


class ByMotion:
    """Frames whose camera has moved or turned enough since the last key frame.

    Args:
        distance: between camera positions (m).
        angle: between camera orientations (rad).
    """

    def __init__(self, distance: float = 0.03, angle: float = 0.15) -> None:
        NOT_NEGATIVE.require(distance=distance, angle=angle)
        self.distance = distance
        self.angle = angle

    def begin(self, state: State | None = None) -> RunningKeyFrames:
        """Starts a sequence or resumes one."""
        return _SinceLast(self._is_new, state)

    def _is_new(self, frame: Frame, last: Camera) -> bool:
        step = geometry.inverse(last.T_world_camera) @ frame.camera.T_world_camera
        distance = float(np.linalg.norm(step[:3, 3]))
        angle = float(np.arccos(np.clip((np.trace(step[:3, :3]) - 1) / 2, -1, 1)))
        return distance >= self.distance or angle >= self.angle


class ByOverlap:
    """Frames of which the last key frame shows too few points.

    Occlusion is ignored: a point counts as seen if it projects into the image.

    Args:
        overlap: least share in [0, 1] of points in view that makes a frame superfluous.
    """

    def __init__(self, overlap: float = 0.8) -> None:
        SHARE.require(overlap=overlap)
        self.overlap = overlap

    def begin(self, state: State | None = None) -> RunningKeyFrames:
        """Starts a sequence or resumes one."""
        return _SinceLast(self._is_new, state)

    def _is_new(self, frame: Frame, last: Camera) -> bool:
        return shared_view(frame, last) < self.overlap


class _Counting:
    def __init__(self, n: int, state: State | None) -> None:
        self.n = n
        self.count = int((state or {}).get("count", 0))

    def takes(self, frame: Frame) -> bool:
        self.count += 1
        return (self.count - 1) % self.n == 0

    def state(self) -> State:
        return {"count": np.array(self.count)}


class _SinceLast:
    """Takes frames that are new beside the last one taken, whose camera is its state."""

    def __init__(self, is_new: Callable[[Frame, Camera], bool], state: State | None) -> None:
        self.is_new = is_new
        self.last = _camera(state)

    def takes(self, frame: Frame) -> bool:
        if self.last is not None and not self.is_new(frame, self.last):
            return False
        self.last = frame.camera
        return True

    def state(self) -> State:
        if self.last is None:
            return {}
        lens = [getattr(self.last, name) for name in _LENS]
        return {"lens": np.array(lens), "pose": np.asarray(self.last.T_world_camera)}


def _camera(state: State | None) -> Camera | None:
    if not state or "lens" not in state:  # of another schedule
        return None
    fx, fy, cx, cy, width, height = state["lens"].tolist()
    return Camera(int(width), int(height), fx, fy, cx, cy).moved(state["pose"])


def shared_view(frame: Frame, target_camera: Camera) -> float:
    """Share in [0, 1] of a frame's measured points that project into another camera's image."""
    camera = frame.camera
    rows, columns = np.nonzero(frame.depth[::_STRIDE, ::_STRIDE] > 0)
    if not len(rows):
        return 1.0  # nothing seen is nothing new
    v, u = rows * _STRIDE, columns * _STRIDE
    depth = frame.depth[v, u].astype(np.float64)
    x, y = (u - camera.cx) / camera.fx * depth, (v - camera.cy) / camera.fy * depth
    motion = geometry.inverse(target_camera.T_world_camera) @ camera.T_world_camera
    points = geometry.transform_points(motion, np.stack([x, y, depth], axis=-1))
    z = np.where(points[:, 2] > 0, points[:, 2], np.nan)
    across = points[:, 0] / z * target_camera.fx + target_camera.cx
    down = points[:, 1] / z * target_camera.fy + target_camera.cy
    inside = (across > -0.5) & (across < target_camera.width - 0.5)
    inside &= (down > -0.5) & (down < target_camera.height - 0.5)
    return float(inside.mean())
