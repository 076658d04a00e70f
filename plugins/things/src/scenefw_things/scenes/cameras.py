"""Cameras of people, robots and phones: near and far, from the side and from above, rolled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.core.geometry import look_at
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.core.types import Camera, Float64
from scenefw_things.shapes.solids import rotation


class HandheldCameras:
    """Random cameras that look at the middle of what lies there.

    Args:
        sizes: widths and heights of images (pixels), each as often.
        distances: to the middle, nearest and farthest (m), log-uniform.
        elevations: lowest and highest angle of sight below the horizon (degrees).
        fields: narrowest and widest horizontal field of view (degrees): telephoto to phone.
        upright: share of cameras that are rolled by no more than a few degrees.
        aside: how far the middle of the image may lie aside, by the image's size.

    Raises:
        ConfigError: a range out of order.
    """

    def __init__(
        self,
        sizes: Sequence[Sequence[int]],
        distances: tuple[float, float] = (0.25, 2.0),
        elevations: tuple[float, float] = (10.0, 90.0),
        fields: tuple[float, float] = (41.0, 77.0),
        upright: float = 0.8,
        aside: float = 0.2,
    ) -> None:
        for name, (low, high) in (("distances", distances), ("fields", fields)):
            POSITIVE.require(**{name: low})
            if low > high:
                raise ConfigError(f"{name} = {[low, high]}: expected the lower number first")
        if not 0 <= elevations[0] <= elevations[1] <= 90:
            raise ConfigError(
                f"elevations = {list(elevations)}: expected 0 to 90 degrees, in order"
            )
        for width, height in sizes:
            COUNT.require(width=width, height=height)
        self.distances, self.elevations, self.fields = distances, elevations, fields
        self.sizes, self.upright, self.aside = (
            [(width, height) for width, height in sizes],
            upright,
            aside,
        )

    def sample(self, rng: np.random.Generator, middle: Float64, radius: float) -> Camera:
        """One camera.

        Args:
            rng: random.
            middle: (3,) of what lies there (m).
            radius: of the smallest ball about it (m): the camera stays outside, and its field of
                view is drawn among those that show a third of it at least.
        """
        nearest = max(self.distances[0], radius + 0.12)
        distance = float(np.exp(rng.uniform(*np.log([nearest, max(nearest, self.distances[1])]))))
        widest = np.rad2deg(2 * np.arctan(3.0 * radius / distance))
        tightest = np.rad2deg(2 * np.arctan(0.35 * radius / distance))
        low, high = np.clip([tightest, widest], *self.fields)
        field = np.deg2rad(rng.uniform(low, max(low, high)))
        width, height = self.sizes[int(rng.integers(len(self.sizes)))]
        focal = width / 2 / np.tan(field / 2)
        azimuth = rng.uniform(0, 2 * np.pi)
        elevation = np.deg2rad(rng.uniform(*self.elevations))
        ahead = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation),
                          np.sin(elevation)])  # fmt: skip
        eye = middle + distance * ahead
        eye[2] = max(eye[2], 0.03)
        pose = look_at(eye, middle)
        roll = rng.normal(0, 0.05) if rng.random() < self.upright else rng.uniform(-np.pi, np.pi)
        spot = rng.uniform(-self.aside, self.aside, 2) * field * (0.5, 0.4)
        pose[:3, :3] = (
            pose[:3, :3] @ rotation(0, spot[1]) @ rotation(1, spot[0]) @ rotation(2, roll)
        )
        return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, pose)
