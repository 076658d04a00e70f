"""Vessels fitted to points of their inside and outside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import least_squares

from scenefw.core.geometry import rigid
from scenefw.core.settings import COUNT, POSITIVE, above
from scenefw.core.types import Pose
from scenefw.fitting.placed import OUTLIERS
from scenefw.shapes.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64

_MAX_PROFILE = 4.0  # of base and curve, or of 1 by them: beyond, it is no vessel but a bottle


@dataclass(frozen=True, eq=False)
class FittedVessel:
    """A vessel where it stands, and how well it explains what it was fitted to.

    Args:
        shape: its numbers.
        pose: from its frame to the world, upright.
        distances: (N,) of the points to the side of the wall that the camera sees (m), below 0 in
            the wall.
        inside: (N,) which of them lie on its inside.
    """

    shape: Vessel
    pose: Pose
    distances: Float64
    inside: NDArray[np.bool_]


@dataclass(eq=False)
class VesselFit:
    """Fits upright vessels by robust least squares, from the box of its upper half.

    Centre, radius, height, shape of the profile and wall are found together. What looks at the
    camera decides on which side of the wall a point lies. A wall is as thick as expected unless
    both of its sides are seen.

    Args:
        sigma: standard deviation of points from the surface (m).
        wall: expected thickness (m).
        wall_sigma: standard deviation of that (m); three of them are the most.
        stands: a vessel whose lowest point is seen no higher stands on the floor (m).
        steps: evaluations at most.

    Raises:
        ConfigError: a number isn't positive, or the wall is thinner than it may deviate.
    """

    sigma: float = 0.003
    wall: float = 0.004
    wall_sigma: float = 0.0005
    stands: float = 0.04
    steps: int = 30

    def __post_init__(self) -> None:
        POSITIVE.require(sigma=self.sigma, wall_sigma=self.wall_sigma, stands=self.stands)
        COUNT.require(steps=self.steps)
        above(OUTLIERS * self.wall_sigma, "as no wall is thinner").require(wall=self.wall)

    def fit(self, points: Float64, eye: Float64) -> FittedVessel:
        """The best vessel.

        Args:
            points: (N, 3) of the world, the floor at z = 0 (m).
            eye: (3,) the camera that sees them (m).
        """
        min_height = float(np.quantile(points[:, 2], 0.02))
        bottom = 0.0 if min_height < self.stands else min_height
        top = float(np.quantile(points[:, 2], 0.99))
        upper = points[points[:, 2] >= np.median(points[:, 2]), :2]
        x, y = (upper.min(axis=0) + upper.max(axis=0)) / 2
        radius = float(np.clip(np.ptp(upper, axis=0).max() / 2, 0.02, 0.15))
        height = max(top - bottom, 0.01)
        least, most = 1 / _MAX_PROFILE, _MAX_PROFILE
        spread = OUTLIERS * self.wall_sigma
        low = [x - 0.1, y - 0.1, 0.012, 0.008, least, least, self.wall - spread]
        high = [x + 0.1, y + 0.1, 0.3, 0.4, most, most, self.wall + spread]
        args = points, eye, bottom, top
        best = least_squares(
            lambda numbers: self._residuals(numbers[None], *args)[0],
            np.clip([x, y, radius, height, 1.0, 1.0, self.wall], low, high),
            lambda numbers: self._jacobian(numbers, *args),
            (low, high),
            x_scale=[0.01, 0.01, 0.01, 0.01, 0.2, 0.2, 0.001],
            loss="soft_l1",
            max_nfev=self.steps,
        )
        return _fitted_vessel(best.x, points, eye, bottom)

    def _residuals(
        self, numbers: Float64, points: Float64, eye: Float64, bottom: float, top: float
    ) -> Float64:
        """Deviations (K, N + 2) of K vessels (K, 7): of points, of the rim, of the wall."""
        # Nothing is seen above the rim, which the points alone don't say
        rim = (bottom + numbers[:, 3] - top) / self.sigma
        wall = (numbers[:, 6] - self.wall) / self.wall_sigma
        weight = np.sqrt(len(points)) / 2
        distances = _first_order_distances(numbers, points, eye, bottom) / self.sigma
        return np.column_stack([distances, weight * rim, wall])

    def _jacobian(self, numbers: Float64, *args: Any) -> Float64:
        """By forward differences, of all numbers at once."""
        step = np.sqrt(np.finfo(np.float64).eps)
        rows = numbers + step * np.eye(len(numbers) + 1, len(numbers), -1)
        values = self._residuals(rows, *args)
        return np.asarray((values[1:] - values[0]).T / step)


def _first_order_distances(
    numbers: Float64, points: Float64, eye: Float64, bottom: float
) -> Float64:
    """Distances (K, N) to the side of the wall that the camera sees, of K vessels (K, 7)."""
    x, y, radius, height, base, curve, wall = numbers.T[..., None]
    offset_x, offset_y, z = points[:, 0] - x, points[:, 1] - y, points[:, 2] - bottom
    flat = np.hypot(offset_x, offset_y)
    t = np.minimum(np.maximum(z, wall) / height, 1.0)
    power = t**curve
    slope = radius * (1 - base) * curve * power / (t * height)
    outer = radius * (base + (1 - base) * power)
    depth = np.minimum((outer - flat) / np.sqrt(1 + slope**2), z)
    depth = np.where(z > height, -np.hypot(flat - radius, z - height), depth)
    to_eye = eye - points
    outward = (offset_x * to_eye[:, 0] + offset_y * to_eye[:, 1]) / np.maximum(flat, 1e-9)
    return np.where(outward < slope * to_eye[:, 2], wall - depth, -depth)


def _distances(
    vessel: Vessel, centre: Float64, points: Float64, eye: Float64, bottom: float
) -> tuple[Float64, NDArray[np.bool_]]:
    """Distances to the side of the wall that the camera sees, and which points lie inside."""
    offsets, height = points[:, :2] - centre, points[:, 2] - bottom
    radii = np.hypot(offsets[:, 0], offsets[:, 1])
    depth = vessel.depth(radii, height)
    # The wall looks outward and, where it widens upward, down
    to_eye = eye - points
    outward = (offsets * to_eye[:, :2]).sum(axis=1) / np.maximum(radii, 1e-9)
    inside = outward < vessel.slope(height) * to_eye[:, 2]
    return np.where(inside, vessel.wall - depth, -depth), inside


def _vessel(numbers: Float64) -> Vessel:
    radius, height, base, curve, wall = (float(value) for value in numbers[2:])
    return Vessel(radius, base, curve, height, wall)


def _fitted_vessel(numbers: Float64, points: Float64, eye: Float64, bottom: float) -> FittedVessel:
    vessel = _vessel(numbers)
    place = np.array([numbers[0], numbers[1], bottom - vessel.bottom])
    distances, inside = _distances(vessel, numbers[:2], points, eye, bottom)
    return FittedVessel(vessel, Pose.from_matrix(rigid(np.eye(3), place)), distances, inside)
