"""Depth images as points in camera or world coordinates."""

import numpy as np
from numpy.typing import NDArray

from scenefw.core import geometry
from scenefw.core.types import Camera, Float64, Frame, Int32

MAJORITY = 0.5
"""Ratio of points, pixels or objects above which it is most of them; so probable is likely."""

MINORITY = 0.1
"""Ratio of them below which it is few."""

STRAYS = 0.02
"""Ratio of them that may be anywhere, whatever the sensor: less says nothing."""

MIN_POINTS = 20
"""Fewer points say nothing about a surface, or a floor."""

SAMPLE = 2000
"""So many points of a surface, evenly spread, say what all of them say."""

DRAWS = 200
"""So many random draws have, but for one time in 10^9, some of each tenth of all (0.9^200)."""

REFINEMENTS = 8
"""Fits of a plane, each to the points near the one before; most planes stay after two."""

MIN_PARALLEL_COSINE = 0.94
"""Of 20 degrees: directions that differ less are parallel, as far as measured normals tell."""


def rays(camera: Camera, stride: int = 1) -> NDArray[np.float64]:
    """Points (H', W', 3), camera coordinates, at a depth of 1 of every `stride`-th pixel."""
    x = (np.arange(0, camera.width, stride) - camera.cx) / camera.fx
    y = (np.arange(0, camera.height, stride) - camera.cy) / camera.fy
    return np.stack([*np.meshgrid(x, y), np.ones((len(y), len(x)))], axis=-1)


def camera_points(frame: Frame, stride: int = 1) -> NDArray[np.float64]:
    """Points (H', W', 3), camera coordinates (m), of every `stride`-th pixel; NaN without depth."""
    depth = frame.depth[::stride, ::stride].astype(np.float64)
    return rays(frame.camera, stride) * np.where(depth > 0, depth, np.nan)[..., None]


def world_points(frame: Frame, stride: int = 1) -> NDArray[np.float64]:
    """Points (H', W', 3), world coordinates (m), of every `stride`-th pixel; NaN without depth."""
    return geometry.transform_points(frame.camera.T_world_camera, camera_points(frame, stride))


def points_by_label(labels: Int32, points: Float64) -> dict[int, Float64]:
    """Points (N, 3) of the pixels with each label above 0, in the order of the image.

    Args:
        labels: (H, W), 0 = none.
        points: (H, W, 3) of the pixels.
    """
    pixels = np.flatnonzero(labels > 0)
    pixels = pixels[np.argsort(labels.ravel()[pixels], kind="stable")]
    numbers, starts = np.unique(labels.ravel()[pixels], return_index=True)
    groups = np.split(points.reshape(-1, 3)[pixels], starts[1:])
    return dict(zip(numbers.tolist(), groups, strict=False))
