"""Rigid-body simulation in PyBullet (Coumans and Bai 2019)."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.core.types import Float64, Pose, SceneObject, Shape, TriangleMesh
from scenefw.shapes.hulls import collision_hulls
from scenefw.shapes.solid_mesh import SolidMesh
from scenefw.shapes.superquadric import Superquadric
from scenefw_simulators.engines.bullet_client import connect


class PyBulletEngine:
    """A PyBullet world of objects on the floor z = 0, in its own client.

    Objects collide as convex hulls, one or several each, whose corners are drawn in by the
    collision margin, which Bullet adds all around: without that, objects rest two margins apart.
    What is simulated depends on the calls since `reset` alone. The world lives in this process: a
    pickled engine starts empty.

    Args:
        time_step: length of a step (s).
        gravity: along -z (m/s^2).
        friction: lateral friction of objects and floor.
        solver_iterations: of the contact solver, per step.
        damping: share of the angular speed lost per second.
        hull_tolerance: width of the band in which a hull follows its shape (m).
        margin: collision margin (m).
        linear_speed: an object rests below this speed (m/s) ...
        angular_speed: ... and below this one (rad/s) ...
        quiet_steps: ... for this many steps in a row.
        check_every: steps between two checks of speeds.

    Raises:
        ConfigError: a number out of range.
    """

    _bullet: Any = None  # here, as `__del__` also follows an `__init__` that refuses its settings

    def __init__(
        self,
        time_step: float = 1 / 240,
        gravity: float = 9.81,
        friction: float = 1.0,
        solver_iterations: int = 50,
        damping: float = 0.5,
        hull_tolerance: float = 7.5e-4,
        margin: float = 1e-3,
        linear_speed: float = 0.005,
        angular_speed: float = 0.05,
        quiet_steps: int = 32,
        check_every: int = 8,
    ) -> None:
        POSITIVE.require(time_step=time_step)
        NOT_NEGATIVE.require(gravity=gravity, friction=friction, damping=damping)
        NOT_NEGATIVE.require(hull_tolerance=hull_tolerance, margin=margin)
        NOT_NEGATIVE.require(linear_speed=linear_speed, angular_speed=angular_speed)
        COUNT.require(solver_iterations=solver_iterations, quiet_steps=quiet_steps)
        COUNT.require(check_every=check_every)
        self.time_step = time_step
        self.gravity = gravity
        self.friction = friction
        self.solver_iterations = solver_iterations
        self.damping = damping
        self.hull_tolerance = hull_tolerance
        self.margin = margin
        self.linear_speed = linear_speed
        self.angular_speed = angular_speed
        self.quiet_steps = quiet_steps
        self.check_every = check_every
        self._client = -1
        self._floor = -1
        self._objects: list[int] = []
        self._quiet = 0

    def reset(self) -> None:
        """Empties the world but for the floor."""
        bullet = self._connect()
        bullet.resetSimulation(physicsClientId=self._client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self.time_step,
            numSolverIterations=self.solver_iterations,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )
        bullet.setGravity(0, 0, -self.gravity, physicsClientId=self._client)
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=self._client)
        self._floor = bullet.createMultiBody(
            0, plane, useMaximalCoordinates=True, physicsClientId=self._client
        )
        bullet.changeDynamics(
            self._floor, -1, lateralFriction=self.friction, physicsClientId=self._client
        )
        self._objects = []
        self._quiet = 0

    @property
    def world(self) -> tuple[Any, int]:
        """The module `pybullet` and the number of its client, for what else acts in the world."""
        if self._bullet is None:
            self.reset()
        return self._bullet, self._client

    def add(self, item: SceneObject, *, multibody: bool = False) -> int:
        """Adds an object and returns its handle.

        Args:
            item: the object.
            multibody: makes a body that constraints between it and an arm hold steadily.
        """
        if self._bullet is None:
            self.reset()
        bullet, client = self._bullet, self._client
        shape = self._collision_shape(item.shape)
        w, x, y, z = item.pose.quaternion
        handle = bullet.createMultiBody(
            item.mass,
            shape,
            basePosition=item.pose.position.tolist(),
            baseOrientation=[x, y, z, w],
            useMaximalCoordinates=not multibody,  # a plain body: three times as fast as a multibody
            physicsClientId=client,
        )
        bullet.changeDynamics(
            handle,
            -1,
            lateralFriction=self.friction,
            angularDamping=self.damping,
            collisionMargin=self.margin,
            physicsClientId=client,
        )
        if isinstance(item.shape, Superquadric | SolidMesh):  # Bullet's own is of the bounding box
            moments = np.float32(item.mass * item.shape.inertia()).tolist()
            bullet.changeDynamics(
                handle,
                -1,
                mass=item.mass,  # else read as 0
                localInertiaDiagonal=moments,
                physicsClientId=client,
            )
        self._objects.append(handle)
        self._quiet = 0
        return int(handle)

    def add_obstacle(self, mesh: TriangleMesh) -> int:
        """Adds a surface that doesn't move, open or closed, and returns its handle."""
        bullet, client = self.world
        shape = bullet.createCollisionShape(
            bullet.GEOM_MESH,
            vertices=mesh.vertices.tolist(),
            indices=mesh.faces.ravel().tolist(),
            flags=bullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=client,
        )
        return int(bullet.createMultiBody(0, shape, physicsClientId=client))

    def remove(self, handle: int) -> None:
        """Takes an object out."""
        self._objects.remove(handle)
        self._bullet.removeBody(handle, physicsClientId=self._client)
        self._quiet = 0

    def overlaps(self, handle: int) -> bool:
        """Whether the object touches another object or the floor where it is now."""
        neighbours = [
            self._floor,
            *(neighbour for neighbour in self._objects if neighbour != handle),
        ]
        return any(
            self._bullet.getClosestPoints(handle, neighbour, 0.0, physicsClientId=self._client)
            for neighbour in neighbours
        )

    def settle(self, max_steps: int) -> bool:
        """Simulates until everything rests, at most `max_steps` steps; whether it came to rest."""
        for _ in range(0, max_steps, self.check_every):
            self.simulate(self.check_every)
            self._quiet = self._quiet + self.check_every if self._slow() else 0
            if self._quiet >= self.quiet_steps:
                return True
        return False

    def simulate(self, steps: int) -> None:
        """Simulates exactly `steps` steps."""
        step, client = self._bullet.stepSimulation, self._client
        for _ in range(steps):
            step(physicsClientId=client)

    def pose(self, handle: int) -> Pose:
        """Pose of the object now."""
        position, (x, y, z, w) = self._bullet.getBasePositionAndOrientation(
            handle, physicsClientId=self._client
        )
        quaternion = np.array([w, x, y, z])
        return Pose(np.array(position), quaternion if w >= 0 else -quaternion)

    def penetration(self) -> float:
        """Depth of the deepest contact of collision hulls (m), 0 if none touch."""
        contacts = self._bullet.getContactPoints(physicsClientId=self._client) or ()
        return max(0.0, -min((contact[8] for contact in contacts), default=0.0))

    def close(self) -> None:
        """Ends the simulation; the next `reset` starts another."""
        if self._bullet is not None and self._bullet.isConnected(self._client):
            self._bullet.disconnect(physicsClientId=self._client)
        self._bullet = None

    def __del__(self) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        fresh: dict[str, Any] = {"_bullet": None, "_client": -1, "_objects": [], "_quiet": 0}
        return self.__dict__ | fresh

    def _connect(self) -> Any:
        if self._bullet is None:
            self._bullet, self._client = connect()
        return self._bullet

    def _collision_shape(self, shape: Shape) -> int:
        bullet, client = self._bullet, self._client
        hulls = collision_hulls(shape, self.hull_tolerance, self.margin)
        if len(hulls) == 1:
            corners = _listed(hulls[0].tobytes())
            shape_id = bullet.createCollisionShape(
                bullet.GEOM_MESH, vertices=corners, physicsClientId=client
            )
        else:
            shape_id = _compound(bullet, hulls, client)
        return int(shape_id)

    def _slow(self) -> bool:
        for handle in self._objects:
            linear, angular = self._bullet.getBaseVelocity(handle, physicsClientId=self._client)
            if sum(v * v for v in linear) > self.linear_speed**2:
                return False
            if sum(v * v for v in angular) > self.angular_speed**2:
                return False
        return True


def _compound(bullet: Any, hulls: Sequence[Float64], client: int) -> int:
    """Several hulls as one shape, which PyBullet takes from a file only.

    Bullet keeps files by name, so that no two shapes may share one.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "parts.obj"
        path.write_text(_as_obj(hulls), encoding="ascii")
        shape_id: int = bullet.createCollisionShape(
            bullet.GEOM_MESH, fileName=str(path), physicsClientId=client
        )
    return shape_id


def _as_obj(hulls: Sequence[Float64]) -> str:
    lines, first = [], 1
    for number, corners in enumerate(hulls):
        lines.append(f"o part_{number}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners]
        triangles = ConvexHull(corners, qhull_options="QJ").simplices + first
        lines += [f"f {a} {b} {c}" for a, b, c in triangles]
        first += len(corners)
    return "\n".join(lines) + "\n"


@lru_cache(maxsize=8192)
def _listed(corners: bytes) -> list[list[float]]:
    """The same list for the same corners, as PyBullet never releases a list."""
    points: list[list[float]] = np.frombuffer(corners).reshape(-1, 3).tolist()
    return points
