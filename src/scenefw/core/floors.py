"""The plane that objects stand on, in the coordinates of the camera that sees it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core import geometry

if TYPE_CHECKING:
    from scenefw.core.types import Float64


@dataclass(frozen=True)
class Floor:
    """A plane in camera coordinates: a point p lies `normal @ p + height` above it.

    Args:
        normal: (3,) unit, up, so towards the camera's side.
        height: of the camera above the plane (m).
        share: of the points within reach that lie on the plane.
        deviation: root mean square distance of those points from the plane (m).
    """

    normal: Float64
    height: float
    share: float
    deviation: float

    @property
    def T_world_camera(self) -> Float64:  # noqa: N802
        """Camera pose (4, 4) in the floor's frame: z up, origin on the floor below the camera.

        The camera looks along +y; straight down, the top of its image points along +y.
        """
        forward = np.array([0.0, 0.0, 1.0])
        along = forward - self.normal * (self.normal @ forward)
        if np.linalg.norm(along) < 0.05:
            image_up = np.array([0.0, -1.0, 0.0])
            along = image_up - self.normal * (self.normal @ image_up)
        y = along / np.linalg.norm(along)
        rotation = np.stack([np.cross(y, self.normal), y, self.normal])
        return geometry.rigid(rotation, (0.0, 0.0, self.height))
