"""Cameras on all sides of a scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from scenefw.core.geometry import look_at
from scenefw.core.settings import COUNT, POSITIVE, between
from scenefw.core.types import Camera

_STEEPEST = 85.0  # degrees: straight down, no side of an image is up
_MARGIN = 1.15  # of the radius of what is to be seen


class SurroundingCameras:
    """Cameras on a ring that look down at the middle of a scene, and one above it.

    They stand as near as the whole scene fits into the image, but no nearer than `nearest`.

    Args:
        width: of the images (pixels).
        height: of the images (pixels).
        focal: length, in pixels of an image 640 wide.
        ring: number of cameras around the scene; one more is above it.
        elevation: of the ring as seen from the middle (degrees).
        nearest: distance to the middle, at least (m).

    Raises:
        ConfigError: a number is out of range.
    """

    def __init__(
        self,
        width: int = 640,
        height: int = 480,
        focal: float = 579.4,
        ring: int = 5,
        elevation: float = 30.0,
        nearest: float = 0.9,
    ) -> None:
        COUNT.require(width=width, height=height, ring=ring)
        POSITIVE.require(focal=focal, nearest=nearest)
        between(5, _STEEPEST).require(elevation=elevation)
        pixels = focal * width / 640
        middle = ((width - 1) / 2, (height - 1) / 2)
        self.camera = Camera(width, height, pixels, pixels, *middle)
        self.ring, self.elevation, self.nearest = ring, elevation, nearest
        self._half_view = np.arctan(min(width, height) / (2 * pixels))

    def around(self, centre: ArrayLike, radius: float) -> Sequence[Camera]:
        """The cameras about a sphere, those of the ring first.

        Args:
            centre: (3,) world coordinates (m).
            radius: of the sphere that is to be seen (m).
        """
        middle = np.asarray(centre, np.float64)
        distance = max(self.nearest, _MARGIN * radius / float(np.sin(self._half_view)))
        turns = 2 * np.pi * np.arange(self.ring) / self.ring
        angles = [(turn, np.radians(self.elevation)) for turn in turns]
        angles.append((0.0, np.radians(_STEEPEST)))
        eyes = [
            middle + distance * np.array([np.cos(t) * np.cos(e), np.sin(t) * np.cos(e), np.sin(e)])
            for t, e in angles
        ]
        return [self.camera.moved(look_at(eye, middle)) for eye in eyes]
