"""Where a suction cup could hold the objects of a scene."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scenefw.core import rng
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.core.types import Float64, SceneObject
from scenefw.metrics.sampling import sample_surface
from scenefw_grasping.grasps import Grasp
from scenefw_grasping.suction import SuctionCup, frame_along
from scenefw_grasping.surfaces import Surfaces

_GRAVITY = 9.81
_VIEWS = 4  # virtual cameras around the scene, beside the one above it
_AWAY = 1.5  # m


class SuctionCandidates:
    """Contacts spread over the surfaces that virtual cameras see (thesis 5.5).

    One camera looks from above, four look from aside. A contact needs a normal that the cup can
    come along, a surface that it seals on, and a load at rest that it holds.

    Args:
        cup: decides where it seals and what it holds.
        payload: of the arm (kg).
        safety: the cup must hold this many times the load, as masses are guesses.
        steepest: angle of normals with the vertical at most (degrees); 90 = walls.
        aside: from this angle on, objects are also taken away along the normal (degrees).
        points: of each object's surface that are looked at.
        most: contacts of each object.
        hidden: also contacts that the real camera did not see.
        seed: of the points.

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        cup: SuctionCup,
        payload: float = 3.0,
        safety: float = 1.5,
        steepest: float = 95.0,
        aside: float = 30.0,
        points: int = 100,
        most: int = 10,
        *,
        hidden: bool = False,
        seed: int = 0,
    ) -> None:
        POSITIVE.require(payload=payload, safety=safety, steepest=steepest)
        COUNT.require(points=points, most=most)
        self.cup, self.payload, self.safety = cup, payload, safety
        self.steepest, self.aside = steepest, aside
        self.points, self.most = points, most
        self.hidden, self.seed = hidden, seed

    def find(
        self, objects: Mapping[int, SceneObject], eye: Float64
    ) -> dict[int, list[Grasp] | str]:
        """Grasps of each object, far from each other at the beginning, or why it has none.

        Args:
            objects: by label.
            eye: (3,) of the camera that saw the scene (m).
        """
        surfaces = Surfaces(objects)
        return {label: self._of(label, item, surfaces, eye) for label, item in objects.items()}

    def _of(
        self, label: int, item: SceneObject, surfaces: Surfaces, eye: Float64
    ) -> list[Grasp] | str:
        load = self.safety * item.mass * _GRAVITY
        max_mass = min(self.payload, self.cup.force / self.safety / _GRAVITY)
        if item.mass > max_mass:
            return (
                f"it is too heavy: about {item.mass:.1f} kg, at most {max_mass:.1f} kg can be held"
            )
        random = rng.generator(self.seed, label)
        points, normals = sample_surface(surfaces.meshes[label], self.points, random)
        visible = surfaces.is_visible(points, normals, eye)
        open_ = np.any(
            [surfaces.is_visible(points, normals, camera) for camera in _eyes(points)], axis=0
        )
        reached = open_ & (normals[:, 2] > np.cos(np.radians(self.steepest)))
        if not reached.any():
            return "no part of its surface can be reached from above or aside"
        if not self.hidden and not (reached & visible).any():
            return "the camera saw no part of it that can be reached"
        allowed = np.flatnonzero(reached if self.hidden else reached & visible)
        poses = [frame_along(-normals[i], points[i]) for i in allowed]
        seals = np.array([self.cup.seal(surfaces, p[:3, 3], p[:3, 2], label) for p in poses])
        if not seals.any():
            return f"it is nowhere flat enough for a cup of {200 * self.cup.radius:.0f} cm"
        flat = np.flatnonzero(seals > 0)
        carriable = [i for i in flat if self.cup.carries(poses[i], item.pose.position, load)]
        if not carriable:
            return f"it would tip off the cup: about {item.mass:.1f} kg too far aside"
        grasps: list[Grasp] = []
        for i in _spread(np.array([poses[i] for i in carriable]), seals[carriable])[: self.most]:
            index = carriable[i]
            ways = (False, True) if self._steep(poses[index]) else (False,)
            grasps += [
                Grasp(label, poses[index], way, float(seals[index]), bool(visible[allowed[index]]))
                for way in ways
            ]
        return grasps

    def _steep(self, pose: Float64) -> bool:
        return bool(-pose[2, 2] < np.cos(np.radians(self.aside)))


def _eyes(points: Float64) -> Float64:
    """Positions (5, 3) of the virtual cameras around an object's points."""
    turns = 2 * np.pi * (np.arange(_VIEWS) + 0.5) / _VIEWS
    aside = np.stack([np.cos(turns), np.sin(turns), np.full(_VIEWS, 0.7)], axis=1)
    return points.mean(axis=0) + _AWAY * np.concatenate([[[0.0, 0.0, 1.0]], aside])


def _spread(poses: Float64, seals: Float64) -> list[int]:
    """An order of poses (N, 4, 4): the best seal first, then always what is farthest from those."""
    places = np.concatenate([poses[:, :3, 3] / 0.1, poses[:, :3, 2]], axis=1)
    order = [int(seals.argmax())]
    gaps = np.linalg.norm(places - places[order[0]], axis=1)
    while len(order) < len(places):
        order.append(int((gaps * (0.5 + seals)).argmax()))
        gaps = np.minimum(gaps, np.linalg.norm(places - places[order[-1]], axis=1))
        gaps[order] = -1.0
    return order
