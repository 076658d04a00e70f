"""Suction grasps, what lifting an object by one does, and films of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenefw.core.types import Float64, SceneObject, TriangleMesh


@dataclass(frozen=True, eq=False)
class Grasp:
    """Where a suction cup touches an object, and which way it takes it.

    Args:
        label: of the object.
        pose: (4, 4) of the cup when it touches, world: origin at the contact (m), z axis into the
            surface.
        outward: first along the surface's normal, then up; else straight up.
        seal: in [0, 1], how flat the surface below the cup is.
        seen: whether the camera saw the contact.
    """

    label: int
    pose: Float64
    outward: bool = False
    seal: float = 1.0
    seen: bool = True

    @property
    def point(self) -> Float64:
        """The contact (3,)."""
        return np.array(self.pose[:3, 3])

    @property
    def normal(self) -> Float64:
        """(3,) unit vector, out of the surface."""
        return -np.array(self.pose[:3, 2])

    def moved(self, motion: Float64) -> Grasp:
        """The grasp when its object has moved by a rigid (4, 4)."""
        return replace(self, pose=motion @ self.pose)


@dataclass(frozen=True, eq=False)
class Film:
    """Rigid parts that move.

    Args:
        meshes: of the parts, each in its own frame (m).
        labels: the object that each part is, 0 for the robot.
        poses: (T, parts, 4, 4) in the world, picture by picture.
        seconds: from one picture to the next.
    """

    meshes: tuple[TriangleMesh, ...]
    labels: tuple[int, ...]
    poses: Float64
    seconds: float


@dataclass(frozen=True, eq=False)
class Lift:
    """What became of one grasp.

    Args:
        label: of the object that the cup touched, 0 = none.
        failure: why it was not lifted, in words; empty if it was.
        shifts: how far each of the other objects moved (m), by label.
        film: of the lift, if it was asked for.
    """

    label: int
    failure: str = ""
    shifts: Mapping[int, float] = field(default_factory=dict)
    film: Film | None = None

    @property
    def lifted(self) -> bool:
        """Whether an object was lifted."""
        return not self.failure

    @property
    def disturbance(self) -> float:
        """Mean displacement of the other objects (m); 0 if there is none (thesis 5.5)."""
        return float(np.mean(list(self.shifts.values()))) if self.shifts else 0.0


@dataclass(frozen=True, eq=False)
class RankedGrasp:
    """A grasp and what the simulation predicts.

    Args:
        grasp: where the objects were seen.
        rehearsed: the same grasp where the simulation's objects rest.
        lift: what it does there.
    """

    grasp: Grasp
    rehearsed: Grasp
    lift: Lift


@dataclass(frozen=True, eq=False)
class Ranking:
    """Grasps of a scene, the best first.

    Args:
        grasps: those that lift their object in the simulation first, by disturbance.
        left_out: why an object has no grasp, in words, by label.
        resting: the objects as the simulation begins, by label.
    """

    grasps: tuple[RankedGrasp, ...]
    left_out: Mapping[int, str]
    resting: Mapping[int, SceneObject]
