"""Depth images as points in camera or world coordinates."""

import numpy as np
from numpy.typing import NDArray

from scenefw.core import geometry
from scenefw.core.types import Frame


def camera_points(frame: Frame, stride: int = 1) -> NDArray[np.float64]:
    """Points (H', W', 3), camera coordinates (m), of every `stride`-th pixel; NaN without depth."""
    camera = frame.camera
    depth = frame.depth[::stride, ::stride].astype(np.float64)
    depth = np.where(depth > 0, depth, np.nan)
    u = np.arange(0, camera.width, stride)
    v = np.arange(0, camera.height, stride)[:, None]
    x = (u - camera.cx) / camera.fx * depth
    y = (v - camera.cy) / camera.fy * depth
    return np.stack([x, y, depth], axis=-1)


def world_points(frame: Frame, stride: int = 1) -> NDArray[np.float64]:
    """Points (H', W', 3), world coordinates (m), of every `stride`-th pixel; NaN without depth."""
    return geometry.transform_points(frame.camera.T_world_camera, camera_points(frame, stride))
