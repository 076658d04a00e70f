"""Simulated lifts: an arm comes along a line, sucks, takes the object away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError
from scenefw.core.geometry import inverse
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.core.types import Float64, SceneObject, Shape, TriangleMesh
from scenefw.shapes.superquadric import Superquadric
from scenefw_grasping.grasps import Film, Grasp, Lift
from scenefw_grasping.panda import Arm, PandaArm
from scenefw_grasping.suction import Meeting, SuctionCup
from scenefw_grasping.surfaces import Surfaces
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine

if TYPE_CHECKING:
    from collections.abc import Iterator

_UP = np.array([0.0, 0.0, 1.0])
_SPACING = 0.05  # m between poses whose joints are solved
_TOLERATED = 12  # steps for which the cup bears too much
_PICTURE = 16  # steps between two pictures of a film
_FLOOR = 0  # number of the floor's body
_COARSE = 16  # quads per side of a superquadric's lattice in films
_AT_ONCE = 4  # grasps whose ways are solved together


class LiftSimulation:
    """Lifts objects with an arm in PyBullet.

    The arm appears `before` the contact, goes straight along the cup's axis until the cup meets a
    surface, sucks, and takes the object away. The cup lets go when it bears more than it can. What
    it meets and whether it seals there depends on the scene that it is in, not on what the grasp
    was meant for.

    Args:
        engine: simulates; the arm needs PyBullet.
        arm: where it stands.
        cup: at its end.
        before: length of the approach (m).
        beyond: the cup goes no further than this past the contact (m).
        out: how far an object is taken along the normal first, if it is (m).
        up: how far it is lifted (m).
        speed: of the cup (m/s).
        rest: steps at most until the others lie still.
        clearance: between arm and objects in a plan (m).
        turns: of the arm about the cup's axis that are tried.

    Raises:
        ConfigError: a number that isn't positive, or an engine without arms.
    """

    def __init__(
        self,
        engine: PyBulletEngine,
        arm: PandaArm,
        cup: SuctionCup,
        before: float = 0.08,
        beyond: float = 0.03,
        out: float = 0.12,
        up: float = 0.15,
        speed: float = 0.25,
        rest: int = 480,
        clearance: float = 0.004,
        turns: int = 6,
    ) -> None:
        if not isinstance(engine, PyBulletEngine):
            raise ConfigError(
                f"grasping needs engine=pybullet, in which its arm is; got {type(engine).__name__}"
            )
        POSITIVE.require(before=before, out=out, up=up, speed=speed)
        COUNT.require(rest=rest, turns=turns)
        self.engine, self.arm, self.cup = engine, arm, cup
        self.before, self.beyond, self.out, self.up = before, beyond, out, up
        self.speed, self.rest, self.clearance, self.turns = speed, rest, clearance, turns
        self._last: tuple[Mapping[int, SceneObject], Surfaces] | None = None

    def feasible(
        self,
        objects: Mapping[int, SceneObject],
        grasps: Sequence[Grasp],
        max_contacts: int,
        obstacles: Sequence[TriangleMesh] = (),
    ) -> list[Grasp]:
        """The first `max_contacts` contacts that the arm reaches without touching anything.

        Their poses are turned about the cup's axis as suits the arm. Grasps of one contact count
        once.
        """
        handles = self._fill(objects, 0)
        arm = self.arm.enter(self.engine.world)
        walls = [self.engine.add_obstacle(mesh) for mesh in obstacles]
        bodies, reachable_grasps = [_FLOOR, *handles.values(), *walls], dict[bytes, list[Grasp]]()
        for start in range(0, len(grasps), _AT_ONCE):
            turned = [self._turned(grasp) for grasp in grasps[start : start + _AT_ONCE]]
            joints, fine = self._reach([grasp for turns in turned for grasp in turns])
            for number, turns in enumerate(turned):
                contact = turns[0].point.tobytes()
                if len(reachable_grasps) >= max_contacts and contact not in reachable_grasps:
                    return [
                        grasp
                        for contact_grasps in reachable_grasps.values()
                        for grasp in contact_grasps
                    ]
                for i, candidate in enumerate(turns, start=number * self.turns):
                    if fine[i] and self._clear(arm, joints[i], bodies):
                        reachable_grasps.setdefault(contact, []).append(candidate)
                        break
        return [grasp for contact_grasps in reachable_grasps.values() for grasp in contact_grasps]

    def lift(self, objects: Mapping[int, SceneObject], grasp: Grasp, *, film: bool = False) -> Lift:
        """What becomes of a grasp in a scene at rest."""
        meeting = self.cup.meet(self._surfaces(objects), grasp.pose, self.before, self.beyond)
        label = meeting.label
        handles = self._fill(objects, label)
        arm = self.arm.enter(self.engine.world)
        approach, taking = self._poses(grasp, meeting.distance)
        joints = self._path(grasp, approach, taking)
        if joints is None:
            still = {neighbour: 0.0 for neighbour in objects if neighbour != label}
            return Lift(label, "the arm doesn't reach it", still)
        shots = _Shots(arm, handles, self.engine) if film else None
        arm.place(joints[0])
        self._drive(arm, approach, joints[: len(approach)], shots)
        failure = self._failure(objects, meeting, arm.tip())
        if not failure:
            arm.hold(handles[label], self.engine.pose(handles[label]).matrix)
        ends = [approach[-1], *taking]
        self._drive(arm, ends, joints[len(approach) - 1 :], shots)
        self._settle(shots)
        failure = failure or self._dropped(arm, objects[label], handles[label])
        shifts = self._shifts(objects, handles, label)
        return Lift(label, failure, shifts, self._film(objects, shots) if shots else None)

    def _surfaces(self, objects: Mapping[int, SceneObject]) -> Surfaces:
        """Those of the scene that was asked for last are kept."""
        if self._last is None or self._last[0] is not objects:
            self._last = (objects, Surfaces(objects))
        return self._last[1]

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_last": None}

    def _fill(self, objects: Mapping[int, SceneObject], held_label: int) -> dict[int, int]:
        self.engine.reset()
        return {
            label: self.engine.add(item, multibody=label == held_label)
            for label, item in objects.items()
        }

    def _turned(self, grasp: Grasp) -> list[Grasp]:
        """The grasp with the cup turned about its axis, step by step."""
        grasps = []
        for angle in 2 * np.pi * np.arange(self.turns) / self.turns:
            turn = np.eye(4)
            turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            grasps.append(replace(grasp, pose=grasp.pose @ turn))
        return grasps

    def _reach(self, grasps: Sequence[Grasp]) -> tuple[list[Float64], NDArray[np.bool_]]:
        """Joint angles (P, 7) of each approach, and whether all of the way can be reached."""
        chain, to_foot = self.arm.chain, inverse(self.arm.foot)
        ways = [self._poses(grasp, self.before) for grasp in grasps]
        angles, reached = chain.anchors(to_foot @ np.array([grasp.pose for grasp in grasps]))
        reverse_path, coming = chain.path(
            to_foot @ np.array([w[0][::-1] for w in ways]), angles, reached
        )
        for outward in (False, True):  # ways of one kind have as many poses
            rows = np.flatnonzero(coming & np.array([g.outward == outward for g in grasps]))
            if len(rows):
                poses = to_foot @ np.array([ways[i][1] for i in rows])
                coming[rows] = chain.path(poses, angles[rows], reached[rows])[1]
        return list(reverse_path[:, ::-1]), coming

    def _path(
        self, grasp: Grasp, approach: Sequence[Float64], taking: Sequence[Float64]
    ) -> Float64 | None:
        """Joint angles (P, 7) of a whole way; None if the arm doesn't reach some of it."""
        chain, to_foot = self.arm.chain, inverse(self.arm.foot)
        angles, reached = chain.anchors(to_foot @ grasp.pose[None])
        reverse_path, came = chain.path(to_foot @ np.array([approach[::-1]]), angles, reached)
        after, went = chain.path(to_foot @ np.array([taking]), reverse_path[:, 0], came)
        return np.concatenate([reverse_path[0, ::-1], after[0]]) if went[0] else None

    def _clear(self, arm: Arm, path: Float64, bodies: Sequence[int]) -> bool:
        for joints in path:
            arm.place(joints)
            if arm.touches(bodies, self.clearance):
                return False
        return True

    def _poses(self, grasp: Grasp, distance: float) -> tuple[list[Float64], list[Float64]]:
        """Poses of the cup up to the contact at a distance, and from there on."""
        start = _shifted(grasp.pose, -self.before * grasp.pose[:3, 2])
        approach = [start, *_along(start, grasp.pose[:3, 2], distance)]
        taking: list[Float64] = []
        if grasp.outward:
            taking += _along(approach[-1], grasp.normal, self.out)
        taking += _along((taking or approach)[-1], _UP, self.up)
        return approach, taking

    def _drive(
        self, arm: Arm, poses: Sequence[Float64], joints: Float64, shots: _Shots | None
    ) -> None:
        strained = 0
        for target in self._targets(poses, joints):
            arm.aim(target)
            self.engine.simulate(1)
            if shots is not None:
                shots.step(1)
            if arm.holding:
                strained = 0 if self.cup.holds(*arm.load()) else strained + 1
                if strained > _TOLERATED:
                    arm.release()

    def _targets(self, poses: Sequence[Float64], joints: Float64) -> Iterator[Float64]:
        for i in range(len(poses) - 1):
            length = float(np.linalg.norm(poses[i + 1][:3, 3] - poses[i][:3, 3]))
            steps = max(1, round(length / self.speed / self.engine.time_step))
            for step in range(1, steps + 1):
                yield joints[i] + (joints[i + 1] - joints[i]) * step / steps

    def _settle(self, shots: _Shots | None) -> None:
        if shots is None:
            self.engine.settle(self.rest)
            return
        for _ in range(0, self.rest, _PICTURE):
            if self.engine.settle(_PICTURE):
                break
            shots.step(_PICTURE)

    def _failure(self, objects: Mapping[int, SceneObject], meeting: Meeting, tip: Float64) -> str:
        if not meeting.label:
            return "the cup meets nothing"
        if not meeting.seal:
            return "the cup doesn't seal"
        item = objects[meeting.label]
        if not self.cup.carries(tip, item.pose.position, item.mass * self.engine.gravity):
            return "the object is too heavy for the cup there"
        return ""

    def _dropped(self, arm: Arm, item: SceneObject, handle: int) -> str:
        rise = self.engine.pose(handle).position[2] - item.pose.position[2]
        if not arm.holding:
            return "the cup lost it"
        return "" if rise > self.up / 2 else "it did not come up"

    def _shifts(
        self, objects: Mapping[int, SceneObject], handles: Mapping[int, int], label: int
    ) -> dict[int, float]:
        shifts = {}
        for neighbour, item in objects.items():
            if neighbour != label:
                end = self.engine.pose(handles[neighbour]).position
                far = float(np.linalg.norm(end - item.pose.position))
                shifts[neighbour] = min(far, 10.0) if np.isfinite(far) else 10.0
        return shifts

    def _film(self, objects: Mapping[int, SceneObject], shots: _Shots) -> Film:
        robot = self.arm.meshes()
        meshes = (*robot, *(_coarse(item.shape) for item in objects.values()))
        labels = (*([0] * len(robot)), *objects)
        return Film(meshes, labels, np.stack(shots.poses), _PICTURE * self.engine.time_step)


class _Shots:
    """Poses of arm and objects, picture by picture."""

    def __init__(self, arm: Arm, handles: Mapping[int, int], engine: PyBulletEngine) -> None:
        self._arm, self._handles, self._engine = arm, handles, engine
        self._steps, self.poses = 0, list[Float64]()

    def step(self, count: int) -> None:
        """Takes a picture if it is time for one."""
        if self._steps % _PICTURE == 0:
            objects = [self._engine.pose(handle).matrix for handle in self._handles.values()]
            self.poses.append(np.concatenate([self._arm.poses(), np.reshape(objects, (-1, 4, 4))]))
        self._steps += count


def _coarse(shape: Shape) -> TriangleMesh:
    """Few triangles for films."""
    return shape.mesh(_COARSE) if isinstance(shape, Superquadric) else shape.mesh()


def _along(start: Float64, direction: Float64, length: float) -> list[Float64]:
    """Poses on a straight way, without its start."""
    count = max(1, int(np.ceil(length / _SPACING)))
    return [_shifted(start, length * i / count * direction) for i in range(1, count + 1)]


def _shifted(pose: Float64, by: Float64) -> Float64:
    new_pose = pose.copy()
    new_pose[:3, 3] += by
    return new_pose
