"""The table of a recording: the plane on which most of what it measured lies.

A single frame may show another plane, such as the floor beside the table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenefw.core.floors import Floor
from scenefw.core.types import Float64, Frame
from scenefw.perception.observation.floor_noise import MAX_FLOOR_HEIGHT
from scenefw.perception.observation.pixels import coarse_step
from scenefw.perception.observation.points import MINORITY, world_points


@dataclass(frozen=True, eq=False)
class WorldPlane:
    """A floor in the world of the poses: normal . x = level (m)."""

    frame: Frame
    normal: Float64
    level: float

    @classmethod
    def of(cls, floor: Floor, frame: Frame) -> WorldPlane:
        """A floor that was found in a frame, by the frame's pose."""
        pose = np.asarray(frame.camera.T_world_camera)
        normal = pose[:3, :3] @ floor.normal
        return cls(frame, normal, float(normal @ pose[:3, 3]) - floor.height)

    def inlier_ratio(self, points: Float64) -> float:
        """Of points (N, 3) of a frame."""
        return float(np.mean(np.abs(points @ self.normal - self.level) < MAX_FLOOR_HEIGHT))


def main_plane(planes: Sequence[WorldPlane]) -> WorldPlane:
    """The first plane on which about as much lies, over all frames, as on any."""
    if len(planes) == 1:
        return planes[0]
    frames = [plane.frame for plane in planes]
    clouds = [world_points(f, coarse_step(f.depth.shape[1])).reshape(-1, 3) for f in frames]
    clouds = [points[~np.isnan(points[:, 2])] for points in clouds]
    supports = [sum(plane.inlier_ratio(points) for points in clouds) for plane in planes]
    enough = (1 - MINORITY) * max(supports)  # fits of one plane in several frames differ by less
    return next(plane for plane, s in zip(planes, supports, strict=True) if s >= enough)
