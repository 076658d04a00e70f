"""A Franka Panda arm with a suction cup, in a PyBullet world.

The arm's description and meshes are those of `pybullet_data` (Apache-2.0), which comes with
PyBullet's wheel.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from functools import cache, cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scenefw.core.errors import MissingDependencyError
from scenefw.core.geometry import inverse, quaternion_from_rotation, rigid, rotation_from_quaternion
from scenefw.core.settings import POSITIVE, above
from scenefw.core.types import Float64, TriangleMesh
from scenefw_grasping.reach import Chain, read_chain

_JOINTS = 7
_TOOL, _TIP = 7, 8  # links
_FORCES = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)  # of the joints at most (N m)
_REST = (0.0, -0.4, 0.0, -2.2, 0.0, 1.9, 0.785)
_FLANGE = 0.107  # m from the last joint's frame
_HAND = ("panda_link8", "panda_hand", "panda_leftfinger", "panda_rightfinger", "panda_grasptarget")
_GAIN = 0.3
_TOOL_XML = """<tool>
<link name="tool">
  <inertial><origin xyz="0 0 0.06"/><mass value="0.4"/>
    <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0 0 0.01"/><geometry>
    <cylinder radius="{mount}" length="0.02"/></geometry></collision>
  <collision><origin xyz="0 0 {middle}"/><geometry>
    <cylinder radius="{rod}" length="{length}"/></geometry></collision>
</link>
<joint name="tool_joint" type="fixed"><parent link="panda_link7"/><child link="tool"/>
  <origin xyz="0 0 {flange}"/></joint>
<link name="tip"><inertial><mass value="0.01"/>
  <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="tip_joint" type="fixed"><parent link="tool"/><child link="tip"/>
  <origin xyz="0 0 {tip}"/></joint>
</tool>"""


class PandaArm:
    """Where the arm stands, and the tool that it carries instead of its hand.

    Args:
        base: (3,) of its foot, world (m).
        turn: of its foot about the vertical (degrees); 0 looks along x.
        tool: from the flange to the rim of the cup (m).
        bellows: length of the soft part at its end, which collides with nothing (m).
        rod: radius of the tool (m).
        cup: radius of the cup as it is drawn (m).

    Raises:
        ConfigError: the tool is too short.
        MissingDependencyError: PyBullet is not installed, or without the arm.
    """

    def __init__(
        self,
        base: Sequence[float] = (-0.52, 0.0, 0.0),
        turn: float = 0.0,
        tool: float = 0.12,
        bellows: float = 0.025,
        rod: float = 0.012,
        cup: float = 0.02,
    ) -> None:
        POSITIVE.require(bellows=bellows, rod=rod, cup=cup)
        above(bellows + 0.03, "3 cm longer than the bellows").require(tool=tool)
        _folder()
        self.base, self.turn = tuple(float(x) for x in base), float(turn)
        self.tool, self.bellows, self.rod, self.cup = tool, bellows, rod, cup

    def enter(self, world: tuple[Any, int]) -> Arm:
        """The arm in a world of PyBullet, in its rest position."""
        bullet, client = world
        half = np.radians(self.turn) / 2
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "panda.urdf"
            file.write_text(self._description(), encoding="utf-8")
            body = bullet.loadURDF(
                str(file),
                basePosition=list(self.base),
                baseOrientation=[0.0, 0.0, float(np.sin(half)), float(np.cos(half))],
                useFixedBase=True,
                physicsClientId=client,
            )
        return Arm(bullet, client, body, self.foot)

    @property
    def foot(self) -> Float64:
        """The pose (4, 4) of its foot."""
        angle = np.radians(self.turn)
        c, s = np.cos(angle), np.sin(angle)
        return rigid([[c, -s, 0], [s, c, 0], [0, 0, 1]], self.base)

    @cached_property
    def chain(self) -> Chain:
        """Its joints, up to the rim of the cup."""
        robot = ElementTree.parse(_folder() / "panda.urdf").getroot()
        names = [f"panda_joint{i + 1}" for i in range(_JOINTS)]
        return read_chain(
            robot, names, np.array(_REST), rigid(np.eye(3), (0, 0, _FLANGE + self.tool))
        )

    def meshes(self) -> tuple[TriangleMesh, ...]:
        """Its links and the tool, each in its own frame, as `Arm.poses` places them."""
        return (*_link_meshes(), self._tool_mesh())

    def _description(self) -> str:
        """The arm as URDF: no hand, no looks, a tool at the flange."""
        folder = _folder()
        tree = ElementTree.parse(folder / "panda.urdf").getroot()
        for part in list(tree):
            child = part.find("child")
            if part.get("name") in _HAND or (child is not None and child.get("link") in _HAND):
                tree.remove(part)
            for looks in part.findall("visual"):
                part.remove(looks)
        for mesh in tree.iter("mesh"):
            mesh.set("filename", str(folder / str(mesh.get("filename")).removeprefix("package://")))
        length = self.tool - self.bellows - 0.02
        text = _TOOL_XML.format(
            mount=0.03, rod=self.rod, length=length, middle=0.02 + length / 2,
            flange=_FLANGE, tip=self.tool,
        )  # fmt: skip
        tree.extend(ElementTree.fromstring(text))
        return ElementTree.tostring(tree, encoding="unicode")

    def _tool_mesh(self) -> TriangleMesh:
        import trimesh

        soft = self.tool - self.bellows
        rings = [(0.03, 0.0, 0.02), (self.rod, 0.02, soft), (self.cup, soft, self.tool)]
        cylinders = [
            trimesh.creation.cylinder(radius, segment=[[0, 0, low], [0, 0, high]], sections=24)
            for radius, low, high in rings
        ]
        mesh = trimesh.util.concatenate(cylinders)
        return TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces))


class Arm:
    """An arm that stands in a world.

    Args:
        bullet: the module `pybullet`.
        client: number of the world.
        body: number of the arm in it.
        foot: (4, 4) pose of its foot.
    """

    def __init__(self, bullet: Any, client: int, body: int, foot: Float64) -> None:
        self._bullet, self._client, self._body, self._foot = bullet, client, body, foot
        self._constraint: int | None = None
        self.place(np.array(_REST))

    def place(self, joints: Float64) -> None:
        """Puts the arm somewhere at once."""
        for i, angle in enumerate(joints):
            self._bullet.resetJointState(self._body, i, float(angle), physicsClientId=self._client)

    def aim(self, joints: Float64) -> None:
        """Where the motors drive to in the steps that follow."""
        self._bullet.setJointMotorControlArray(
            self._body,
            list(range(_JOINTS)),
            self._bullet.POSITION_CONTROL,
            targetPositions=[float(angle) for angle in joints],
            forces=list(_FORCES),
            positionGains=[_GAIN] * _JOINTS,
            physicsClientId=self._client,
        )

    def touches(self, bodies: Sequence[int], clearance: float) -> bool:
        """Whether a moving link comes closer than `clearance` to other bodies where it is (m)."""
        for body in bodies:
            closest_points = self._bullet.getClosestPoints(
                self._body, body, clearance, physicsClientId=self._client
            )
            if any(point[3] > 0 for point in closest_points):
                return True
        return False

    def hold(self, handle: int, pose: Float64) -> None:
        """Ties a body at a pose (4, 4) to the cup as they are now."""
        bullet, client = self._bullet, self._client
        relative = inverse(pose) @ self.tip()
        bullet_pose = _position_and_quaternion(relative)
        self._constraint = bullet.createConstraint(
            self._body, _TIP, handle, -1, bullet.JOINT_FIXED, [0, 0, 0], [0, 0, 0],
            bullet_pose[0], [0, 0, 0, 1], bullet_pose[1], physicsClientId=client,
        )  # fmt: skip
        bullet.changeConstraint(self._constraint, maxForce=1000.0, physicsClientId=client)
        for link in range(-1, _TIP + 1):
            bullet.setCollisionFilterPair(self._body, handle, link, -1, 0, physicsClientId=client)

    def load(self) -> tuple[Float64, Float64]:
        """Force (3,) and moment (3,) of the held body on the cup, in the cup's frame (N, N m)."""
        state = self._bullet.getConstraintState(self._constraint, physicsClientId=self._client)
        force, moment = np.reshape(state, (2, 3)) @ self.tip()[:3, :3]  # of the world, turned
        return force, moment

    def release(self) -> None:
        """Lets go."""
        if self._constraint is not None:
            self._bullet.removeConstraint(self._constraint, physicsClientId=self._client)
        self._constraint = None

    @property
    def holding(self) -> bool:
        """Whether a body is tied to the cup."""
        return self._constraint is not None

    def tip(self) -> Float64:
        """The pose (4, 4) of the cup."""
        return self._link(_TIP)

    def poses(self) -> Float64:
        """Poses (9, 4, 4) of foot, links and tool."""
        return np.stack([self._foot, *(self._link(i) for i in range(_TOOL + 1))])

    def _link(self, number: int) -> Float64:
        state = self._bullet.getLinkState(
            self._body, number, computeForwardKinematics=1, physicsClientId=self._client
        )
        x, y, z, w = state[5]
        return rigid(rotation_from_quaternion([w, x, y, z]), state[4])


def _position_and_quaternion(pose: Float64) -> tuple[list[float], list[float]]:
    """As PyBullet wants them: x, y, z and x, y, z, w."""
    w, x, y, z = quaternion_from_rotation(pose[:3, :3]).tolist()
    return pose[:3, 3].tolist(), [x, y, z, w]


def _folder() -> Path:
    try:
        import pybullet_data
    except ImportError as error:
        raise MissingDependencyError(
            "grasping needs pybullet with its arm: pip install 'scenefw[simulation]'"
        ) from error
    folder = Path(pybullet_data.getDataPath()) / "franka_panda"
    if not (folder / "panda.urdf").is_file():
        raise MissingDependencyError(
            f"{folder} holds no arm; install PyBullet from PyPI: pip install 'scenefw[simulation]'"
        )
    return folder


@cache
def _link_meshes() -> tuple[TriangleMesh, ...]:
    import trimesh

    meshes = []
    for number in range(_JOINTS + 1):
        path = _folder() / "meshes" / "collision" / f"link{number}.obj"
        mesh = trimesh.load(path, force="mesh", process=False, skip_materials=True)
        meshes.append(TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces)))
    return tuple(meshes)
