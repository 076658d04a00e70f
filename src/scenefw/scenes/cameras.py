"""Random cameras around a table-top scene (thesis 5.2.1, "Random viewpoint generation")."""

from __future__ import annotations

import numpy as np

from scenefw.core.errors import ConfigError, SettingError
from scenefw.core.geometry import look_at
from scenefw.core.rng import Streams
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.core.types import Camera, Float64


class RandomViewpoints:
    """Cameras at random places that look at the centre of the scene.

    Positions are uniform in a box around the z axis; those too near the centre are drawn again.

    Args:
        width: of the images (pixels).
        height: of the images (pixels).
        fx: focal length of the full-size camera (pixels), as fy, cx and cy; scaled to the images.
        fy: see `fx`.
        cx: see `fx`.
        cy: see `fx`.
        full_size: width and height for which the intrinsics are given.
        radius: x and y of the camera lie in +-radius (m).
        heights: lowest and highest camera over the floor (m).
        closest: smallest distance to the centre (m).
        centre: what cameras look at, in world coordinates (m).
        jitter: the point looked at is moved by up to this much along each axis (m).

    Raises:
        ConfigError: the image size or another number is out of range, heights are not in order, or
            no position in the box is far enough from the centre.
    """

    def __init__(
        self,
        width: int = 640,
        height: int = 480,
        fx: float = 579.4,
        fy: float = 579.4,
        cx: float = 319.5,
        cy: float = 239.5,
        full_size: tuple[int, int] = (640, 480),
        radius: float = 1.0,
        heights: tuple[float, float] = (0.1, 1.0),
        closest: float = 0.78,
        centre: tuple[float, float, float] = (0.0, 0.0, 0.1),
        jitter: float = 0.03,
    ) -> None:
        COUNT.require(width=width, height=height, full_size=full_size)
        POSITIVE.require(radius=radius, fx=fx, fy=fy)
        NOT_NEGATIVE.require(closest=closest, jitter=jitter)
        low, high = heights
        if low > high:
            raise SettingError("heights", heights, "two heights (m), the lower first")
        corner = np.array([radius, radius, max((low, high), key=lambda z: abs(z - centre[2]))])
        if np.linalg.norm(corner + np.abs([*centre[:2], 0]) - [0, 0, centre[2]]) <= closest:
            raise ConfigError(
                f"viewpoints.closest = {closest} m leaves no place within {radius} m; lower it"
            )
        self.width, self.height = width, height
        self.camera = Camera(*full_size, fx, fy, cx, cy).resized(width, height)
        self.lower = np.array([-radius, -radius, low])
        self.upper = np.array([radius, radius, high])
        self.closest = closest
        self.centre = np.asarray(centre, dtype=np.float64)
        self.jitter = jitter

    def sample(self, rng: np.random.Generator) -> Camera:
        """One camera."""
        position = rng.uniform(self.lower, self.upper)
        while np.linalg.norm(position - self.centre) < self.closest:
            position = rng.uniform(self.lower, self.upper)
        target = self.centre + rng.uniform(-self.jitter, self.jitter, size=3)
        return self.camera.moved(look_at(position, target))

    def poses(self, streams: Streams) -> Float64:
        """`T_world_camera` (B, 4, 4) of one camera per stream, distributed as those of `sample`."""
        target = self.centre + self.jitter * (2 * streams.uniform(3) - 1)
        position = np.empty_like(target)
        rows, draws = np.arange(len(streams)), 3
        while len(rows):
            samples = Streams(streams.keys[rows]).uniform(3, draws)
            position[rows] = self.lower + (self.upper - self.lower) * samples
            distances = np.linalg.norm(position[rows] - self.centre, axis=-1)
            rows, draws = rows[distances < self.closest], draws + 3
        return look_at(position, target)
