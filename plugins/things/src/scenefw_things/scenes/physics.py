"""Things fall, slide and come to rest in PyBullet, as compounds of their own convex parts."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.core.types import Float64, Pose
from scenefw_simulators.engines.bullet_client import connect
from scenefw_things.shapes.solids import Part


class FastPhysics:
    """A PyBullet world for many short simulations: coarse steps, ended when all is at rest.

    It is not exact enough for stacks that must stand for seconds (`scenes.engines`), but scenes
    need only look as if they stood.

    Args:
        time_step: s.
        max_seconds: simulated at most.
        friction: of everything.
        margin: collision margin (m); things rest two of them apart.
        damping: share of speeds lost per second.
        density: of everything (kg/m^3).
        max_speed: all rest when none is faster (m/s).
        check_every: steps between two looks at speeds.

    Raises:
        ConfigError: a number out of range.
    """

    def __init__(
        self,
        time_step: float = 0.008,
        max_seconds: float = 1.5,
        friction: float = 0.6,
        margin: float = 2e-4,
        damping: float = 0.5,
        density: float = 500.0,
        max_speed: float = 0.02,
        check_every: int = 8,
    ) -> None:
        POSITIVE.require(time_step=time_step, max_seconds=max_seconds, density=density)
        NOT_NEGATIVE.require(friction=friction, margin=margin, damping=damping)
        POSITIVE.require(max_speed=max_speed)
        COUNT.require(check_every=check_every)
        self.time_step, self.max_seconds = time_step, max_seconds
        self.friction, self.margin, self.damping = friction, margin, damping
        self.density, self.max_speed, self.check_every = density, max_speed, check_every
        self._bullet: Any = None
        self._client = -1
        self._movable: list[int] = []

    def begin(self, *, floor: bool) -> None:
        """Empties the world but for the plane z = 0, if there is a floor at that height."""
        bullet = self._connect()
        bullet.resetSimulation(physicsClientId=self._client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self.time_step,
            numSolverIterations=20,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )
        bullet.setGravity(0, 0, -9.81, physicsClientId=self._client)
        self._movable = []
        if floor:
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=self._client)
            body = bullet.createMultiBody(0, plane, physicsClientId=self._client)
            bullet.changeDynamics(
                body, -1, lateralFriction=self.friction, physicsClientId=self._client
            )

    def add(self, parts: Sequence[Part], pose: Pose, *, fixed: bool = False) -> int:
        """Adds convex parts as one body; returns its handle."""
        bullet, client = self._bullet, self._client
        centre, mass, spread = _mass(parts, self.density)
        shape = self._shape([part.corners - centre for part in parts])
        w, x, y, z = pose.quaternion
        body = bullet.createMultiBody(
            0 if fixed else mass,
            shape,
            basePosition=(pose.position + pose.rotation @ centre).tolist(),
            baseOrientation=[x, y, z, w],
            useMaximalCoordinates=True,
            physicsClientId=client,
        )
        bullet.changeDynamics(
            body, -1, lateralFriction=self.friction, rollingFriction=2e-4, spinningFriction=2e-4,
            linearDamping=self.damping, angularDamping=self.damping, collisionMargin=self.margin,
            physicsClientId=client,
        )  # fmt: skip
        if not fixed:
            bullet.changeDynamics(
                body, -1, mass=mass, localInertiaDiagonal=(mass * spread).tolist(),
                physicsClientId=client,
            )  # fmt: skip
            self._movable.append(body)
        return int(body)

    def settle(self) -> bool:
        """Simulates until everything rests, for `max_seconds` at most; whether it rests."""
        quiet = 0
        for _ in range(round(self.max_seconds / self.time_step / self.check_every)):
            for _ in range(self.check_every):
                self._bullet.stepSimulation(physicsClientId=self._client)
            quiet = quiet + 1 if self._slow() else 0
            if quiet == 2:
                return True
        return False

    def pose(self, body: int, parts: Sequence[Part]) -> Pose:
        """Where the frame of the parts is now."""
        position, (x, y, z, w) = self._bullet.getBasePositionAndOrientation(
            body, physicsClientId=self._client
        )
        turn = Pose(np.zeros(3), np.array([w, x, y, z]) * (1 if w >= 0 else -1))
        centre, _, _ = _mass(parts, self.density)
        return Pose(np.array(position) - turn.rotation @ centre, turn.quaternion)

    def penetration(self, body: int) -> float:
        """Depth of the deepest contact of a body (m)."""
        contacts = self._bullet.getContactPoints(body, physicsClientId=self._client) or ()
        return max(0.0, -min((contact[8] for contact in contacts), default=0.0))

    def close(self) -> None:
        """Ends the simulation."""
        if self._bullet is not None and self._bullet.isConnected(self._client):
            self._bullet.disconnect(self._client)
        self._bullet = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_bullet": None, "_client": -1, "_movable": []}

    def _slow(self) -> bool:
        for body in self._movable:
            linear, angular = self._bullet.getBaseVelocity(body, physicsClientId=self._client)
            speed = sum(v * v for v in linear) + (_ARM**2) * sum(v * v for v in angular)
            if speed > self.max_speed**2:
                return False
        return True

    def _connect(self) -> Any:
        if self._bullet is None:
            self._bullet, self._client = connect()
        return self._bullet

    def _shape(self, solids: Sequence[Float64]) -> int:
        """One compound, which PyBullet reads from a file only, by a name that is not used twice."""
        with tempfile.TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as folder:
            path = Path(folder) / "parts.obj"
            path.write_text(_as_obj(solids), encoding="ascii")
            shape: int = self._bullet.createCollisionShape(
                self._bullet.GEOM_MESH, fileName=str(path), physicsClientId=self._client
            )
        return shape


_ARM = 0.05  # m: a turn counts as the speed at this distance from its axis
_MEMORY = Path("/dev/shm")  # where files cost nothing, on Linux


def _as_obj(solids: Sequence[Float64]) -> str:
    lines: list[str] = []
    first = 1
    for number, corners in enumerate(solids):
        lines.append(f"o part_{number}")
        lines += [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in corners.tolist()]
        lines += [f"f {first + i} {first + i + 1} {first + i + 2}" for i in range(len(corners) - 2)]
        first += len(corners)
    return "\n".join(lines) + "\n"


def _mass(parts: Sequence[Part], density: float) -> tuple[Float64, float, Float64]:
    """Centre (3,), mass (kg) and spread (3,) m^2 about the axes, of boxes about the parts."""
    low = np.array([part.corners.min(axis=0) for part in parts])
    high = np.array([part.corners.max(axis=0) for part in parts])
    size = np.maximum(high - low, 1e-4)
    weights = size.prod(axis=1)
    centres = (low + high) / 2
    centre = weights @ centres / weights.sum()
    second = (size**2 / 12 + (centres - centre) ** 2).T @ weights / weights.sum()
    return centre, float(0.6 * density * weights.sum()), second.sum() - second
