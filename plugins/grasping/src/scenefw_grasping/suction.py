"""A suction cup: where it seals, and what it holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenefw.core.settings import POSITIVE
from scenefw.core.types import Float64
from scenefw_grasping.surfaces import Surfaces

_START = 0.03  # m in front of the contact, from where the surface is felt
_RINGS = ((0.0, 1), (0.5, 8), (1.0, 16))  # radii in radii of the cup, and points


@dataclass(frozen=True)
class Meeting:
    """Where the cup meets a scene.

    Args:
        label: of the object, 0 = none.
        distance: along the cup's axis from where it started (m).
        seal: in [0, 1]; 0 = it doesn't seal.
    """

    label: int
    distance: float
    seal: float


class SuctionCup:
    """A round bellows cup under vacuum.

    It seals where the surface below departs from a plane by no more than its bellows give. Pull,
    shear and moment at the contact are limited as by Mahler et al. (2018): the pull by the vacuum
    on the cup's area, the shear by friction of what presses the cup on, the moment by tipping over
    the rim.

    Args:
        radius: of the cup (m).
        give: how far the bellows follow the surface to either side (m).
        vacuum: pressure below that of the air (Pa).
        friction: of the cup on a surface.

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        radius: float = 0.02,
        give: float = 0.003,
        vacuum: float = 70e3,
        friction: float = 0.5,
    ) -> None:
        POSITIVE.require(radius=radius, give=give, vacuum=vacuum, friction=friction)
        self.radius, self.give, self.vacuum, self.friction = radius, give, vacuum, friction

    @property
    def force(self) -> float:
        """What the vacuum presses on (N)."""
        return float(np.pi * self.radius**2 * self.vacuum)

    def holds(self, force: Float64, moment: Float64) -> bool:
        """Whether the cup holds a load at the contact, in its frame (z into the surface).

        Args:
            force: (3,) that the object exerts on the cup (N); +z pulls them apart.
            moment: (3,) about the contact (N m).
        """
        pressed = self.force - max(float(force[2]), 0.0)
        slips = float(np.hypot(force[0], force[1])) > self.friction * pressed
        tips = float(np.hypot(moment[0], moment[1])) > self.radius * pressed
        twists = abs(float(moment[2])) > self.friction * self.radius * pressed
        return pressed > 0 and not (slips or tips or twists)

    def carries(self, pose: Float64, centre: Float64, weight: float) -> bool:
        """Whether it holds a resting object.

        Args:
            pose: (4, 4) of the cup, z into the surface.
            centre: (3,) of mass.
            weight: in newtons.
        """
        force = np.array([0.0, 0.0, -weight])
        moment = np.cross(centre - pose[:3, 3], force)
        return self.holds(pose[:3, :3].T @ force, pose[:3, :3].T @ moment)

    def meet(self, surfaces: Surfaces, pose: Float64, before: float, overshoot: float) -> Meeting:
        """What the cup meets on its way along its axis, and whether it seals there.

        Args:
            surfaces: of the scene.
            pose: (4, 4) of the cup where it is meant to touch.
            before: how far before that it starts (m).
            overshoot: how far beyond that it goes at most (m).
        """
        start, axis = pose[:3, 3] - before * pose[:3, 2], pose[:3, 2]
        (distance,), (label,) = surfaces.cast(start[None], axis)
        if distance > before + overshoot:
            return Meeting(0, before, 0.0)
        seal = self.seal(surfaces, start + distance * axis, axis, int(label))
        return Meeting(int(label), float(distance), seal)

    def seal(self, surfaces: Surfaces, point: Float64, axis: Float64, label: int) -> float:
        """How flat an object is below the cup: 1 = a plane, 0 = it doesn't seal."""
        across = _across(axis)
        turns = [(r * self.radius, 2 * np.pi * i / n) for r, n in _RINGS for i in range(n)]
        offsets = np.array([[r * np.cos(a), r * np.sin(a)] for r, a in turns])
        distances, labels = surfaces.cast(point - _START * axis + offsets @ across, axis)
        if (labels != label).any():
            return 0.0
        design = np.column_stack([offsets, np.ones(len(offsets))])
        plane, *_ = np.linalg.lstsq(design, distances, rcond=None)
        bend = float(np.abs(distances - design @ plane).max()) / self.give
        tilt = float(np.linalg.norm(plane[:2])) * self.radius / self.give
        return max(0.0, 1.0 - max(bend, tilt))


def frame_along(axis: Float64, point: Float64, turn: float = 0.0) -> Float64:
    """A pose (4, 4) whose z axis is a unit vector, turned about it (radians)."""
    x, y = _across(axis)
    pose = np.eye(4)
    pose[:3, 0] = np.cos(turn) * x + np.sin(turn) * y
    pose[:3, 1] = np.cross(axis, pose[:3, 0])
    pose[:3, 2], pose[:3, 3] = axis, point
    return pose


def _across(axis: Float64) -> Float64:
    """Two unit vectors (2, 3) across a unit vector; the first is level unless it is upright."""
    level = np.array([-axis[1], axis[0], 0.0])
    length = float(np.linalg.norm(level))
    x = level / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
    return np.stack([x, np.cross(axis, x)])
