"""Poses and sizes from which fits of shapes to points begin."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from scenefw.core.types import Pose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Float64

_TAIL = 0.04  # ratio of points beyond either end that don't say how far a cloud extends


def box_starts(
    points: Float64, reliable_points: Float64 | None = None
) -> list[tuple[Pose, Float64]]:
    """Poses and half-axes to start a fit from: upright at two angles, and along principal axes.

    Args:
        points: (N, 3) of the surface (m).
        reliable_points: (M, 3) those of them that are sure, if not all are: one more box about
            these alone.
    """
    turn = _min_rectangle_angle(points[:, :2])
    upright = [Rotation.from_euler("z", angle).as_matrix() for angle in (turn, turn + np.pi / 4)]
    boxes = _boxes(points, [*upright, _principal(points)])
    if reliable_points is None or not 3 < len(reliable_points) < len(points):
        return boxes
    return [*boxes, *_boxes(reliable_points, [_principal(reliable_points)])]


def _principal(points: Float64) -> Float64:
    """The rotation (3, 3) to the principal axes of points (N, 3), the least one first."""
    _, axes = np.linalg.eigh(np.cov(points.T))
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return np.asarray(axes)


def _boxes(points: Float64, rotations: Sequence[Float64]) -> list[tuple[Pose, Float64]]:
    """Poses and half-axes of boxes about points (N, 3), turned by each rotation (3, 3)."""
    corners = np.quantile(points @ np.stack(rotations), (_TAIL, 1 - _TAIL), axis=1)
    quaternions = np.roll(Rotation.from_matrix(rotations).as_quat(), 1, axis=1)
    return [
        (Pose(rotation @ ((low + high) / 2), quaternion), np.maximum((high - low) / 2, 0.005))
        for rotation, quaternion, low, high in zip(rotations, quaternions, *corners, strict=True)
    ]


def _min_rectangle_angle(points: Float64) -> float:
    """The angle of the least rectangle about points (N, 2); one side lies on their hull."""
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:  # all on one line
        return 0.0
    sides = np.roll(corners, -1, axis=0) - corners
    angles = np.arctan2(sides[:, 1], sides[:, 0])
    c, s = np.cos(angles), np.sin(angles)
    along = corners @ np.stack([c, s])
    across = corners @ np.stack([-s, c])
    return float(angles[(np.ptp(along, axis=0) * np.ptp(across, axis=0)).argmin()])
