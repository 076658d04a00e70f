"""Rigid-body simulation in MuJoCo (Todorov et al. 2012)."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from scenefw.core.errors import MissingDependencyError
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.core.types import Float64, Pose, SceneObject, Shape
from scenefw.shapes.hulls import collision_hulls
from scenefw.shapes.moments import moments
from scenefw.shapes.solid_mesh import SolidMesh
from scenefw.shapes.superquadric import Superquadric

_FLOOR = 0  # id of its geometry, the first
_IMPEDANCE = (0.95, 0.99, 0.001, 0.5, 2.0)  # of contacts: stiff, so that little sinks in


class MujocoEngine:
    """A MuJoCo world of objects on the floor z = 0.

    Objects collide as convex hulls, one or several each. The model is compiled anew when an object
    comes or goes; those that are there keep their motion. What is simulated depends on the calls
    since `reset` alone. A pickled engine starts empty.

    Args:
        time_step: length of a step (s).
        substeps: of the simulation per step: its soft contacts need short ones.
        gravity: along -z (m/s^2).
        friction: lateral friction of objects and floor.
        damping: share of the angular speed lost per second.
        hull_tolerance: width of the band in which a hull follows its shape (m).
        linear_speed: an object rests below this speed (m/s) ...
        angular_speed: ... and below this one (rad/s) ...
        quiet_steps: ... for this many steps in a row.
        check_every: steps between two checks of speeds.

    Raises:
        ConfigError: a number out of range.
    """

    def __init__(
        self,
        time_step: float = 1 / 240,
        substeps: int = 2,
        gravity: float = 9.81,
        friction: float = 1.0,
        damping: float = 0.5,
        hull_tolerance: float = 7.5e-4,
        linear_speed: float = 0.005,
        angular_speed: float = 0.05,
        quiet_steps: int = 32,
        check_every: int = 8,
    ) -> None:
        POSITIVE.require(time_step=time_step)
        NOT_NEGATIVE.require(gravity=gravity, friction=friction, damping=damping)
        NOT_NEGATIVE.require(hull_tolerance=hull_tolerance)
        NOT_NEGATIVE.require(linear_speed=linear_speed, angular_speed=angular_speed)
        COUNT.require(substeps=substeps, quiet_steps=quiet_steps)
        COUNT.require(check_every=check_every)
        self.time_step = time_step
        self.substeps = substeps
        self.gravity = gravity
        self.friction = friction
        self.damping = damping
        self.hull_tolerance = hull_tolerance
        self.linear_speed = linear_speed
        self.angular_speed = angular_speed
        self.quiet_steps = quiet_steps
        self.check_every = check_every
        self._objects: dict[int, SceneObject] = {}
        self._motion: dict[int, tuple[Float64, Float64]] = {}
        self._next = 1
        self._quiet = 0
        self._world: Any = None

    def reset(self) -> None:
        """Empties the world but for the floor."""
        _mujoco()
        self._objects, self._motion, self._next = {}, {}, 1
        self._world, self._quiet = None, 0

    def add(self, item: SceneObject) -> int:
        """Adds an object and returns its handle."""
        self._keep_motion()
        handle, self._next = self._next, self._next + 1
        self._objects[handle] = item
        self._motion[handle] = (
            np.concatenate([item.pose.position, item.pose.quaternion]),
            np.zeros(6),
        )
        return handle

    def remove(self, handle: int) -> None:
        """Takes an object out."""
        self._keep_motion()
        del self._objects[handle], self._motion[handle]

    def overlaps(self, handle: int) -> bool:
        """Whether the object touches another object or the floor where it is now."""
        model, data = self._running()
        mujoco = _mujoco()
        mujoco.mj_fwdPosition(model, data)
        body = 1 + list(self._objects).index(handle)
        contacts = data.contact
        owners = model.geom_bodyid[contacts.geom].reshape(-1, 2)
        return bool(((contacts.dist <= 0) & (owners == body).any(axis=1)).any())

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
        model, data = self._running()
        _mujoco().mj_step(model, data, nstep=steps * self.substeps)

    def pose(self, handle: int) -> Pose:
        """Pose of the object now."""
        if self._world is None:
            values = self._motion[handle][0]
        else:
            row = list(self._objects).index(handle)
            values = np.array(self._world[1].qpos[7 * row : 7 * row + 7])
        quaternion = values[3:] / np.linalg.norm(values[3:])
        return Pose(values[:3].copy(), quaternion if quaternion[0] >= 0 else -quaternion)

    def penetration(self) -> float:
        """Depth of the deepest contact of collision hulls (m), 0 if none touch."""
        distances = self._running()[1].contact.dist
        return max(0.0, -float(distances.min(initial=0.0)))

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_world": None, "_objects": {}, "_motion": {}, "_next": 1}

    def _slow(self) -> bool:
        speeds = self._running()[1].qvel.reshape(-1, 2, 3)
        linear, angular = np.linalg.norm(speeds, axis=2).T
        return bool((linear <= self.linear_speed).all() and (angular <= self.angular_speed).all())

    def _keep_motion(self) -> None:
        """Takes positions and speeds out of the model, which is compiled anew when needed."""
        if self._world is None:
            return
        data = self._world[1]
        for row, handle in enumerate(self._objects):
            position = np.array(data.qpos[7 * row : 7 * row + 7])
            self._motion[handle] = (position, np.array(data.qvel[6 * row : 6 * row + 6]))
        self._world, self._quiet = None, 0

    def _running(self) -> tuple[Any, Any]:
        if self._world is None:
            self._world = self._compiled()
        return self._world

    def _compiled(self) -> tuple[Any, Any]:
        mujoco = _mujoco()
        spec = mujoco.MjSpec()
        spec.option.timestep = self.time_step / self.substeps
        spec.option.gravity = (0, 0, -self.gravity)
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.impratio = 10  # or resting things slide
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # keeps what is lost lost
        self._geometry(spec.worldbody, type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
        for handle, item in self._objects.items():
            self._body(spec, handle, item)
        model = spec.compile()
        data = mujoco.MjData(model)
        for row, (position, speed) in enumerate(self._motion.values()):
            data.qpos[7 * row : 7 * row + 7] = position
            data.qvel[6 * row : 6 * row + 6] = speed
            turning = slice(6 * row + 3, 6 * row + 6)
            model.dof_damping[turning] = self.damping * model.body_inertia[row + 1]
        return model, data

    def _body(self, spec: Any, handle: int, item: SceneObject) -> None:
        mujoco = _mujoco()
        body = spec.worldbody.add_body(name=f"object_{handle}")
        body.add_freejoint()
        body.mass, body.inertia = item.mass, item.mass * _inertia(item.shape)
        body.ipos, body.explicitinertial = (0, 0, 0), True
        for number, corners in enumerate(collision_hulls(item.shape, self.hull_tolerance, 0.0)):
            name = f"part_{handle}_{number}"
            spec.add_mesh(name=name, uservert=np.float32(corners).ravel(), **_faces(corners))
            self._geometry(body, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)

    def _geometry(self, body: Any, **options: Any) -> None:
        time = 2 * self.time_step / self.substeps  # the shortest that is stable
        body.add_geom(
            friction=(self.friction, 0.005, 0.0001),
            solref=(time, 1.0),
            solimp=_IMPEDANCE,
            **options,
        )


def _faces(corners: Float64) -> dict[str, Any]:
    """Faces of the hull of (K, 3), outward."""
    hull = ConvexHull(corners, qhull_options="QJ")
    faces = hull.simplices.copy()
    a, b, c = corners[faces].swapaxes(0, 1)
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return {"userface": np.int32(faces).ravel()}


def _inertia(shape: Shape) -> Float64:
    """Moments of inertia (3,) about the shape's axes per unit mass (m^2)."""
    if isinstance(shape, Superquadric | SolidMesh):
        return shape.inertia()
    spread = moments(shape.mesh()).spread
    return np.full(3, spread.sum() - spread.min())


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError as error:
        raise MissingDependencyError(
            "engine=mujoco needs mujoco: pip install 'scenefw[mujoco]'"
        ) from error
    return mujoco
