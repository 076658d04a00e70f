"""Robot arms and a gripper of PyBullet's data, in random postures: the hull of each link's mesh."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from scipy.spatial import ConvexHull

from scenefw.core.types import Float64
from scenefw_things.shapes.bullet import data_folder
from scenefw_things.shapes.family import family
from scenefw_things.shapes.solids import Part, moved, painted, rotation

_ARMS = ("franka_panda/panda.urdf", "kuka_iiwa/model.urdf")
_HAND = "panda_hand"
_MAX_CORNERS = 120  # of a link's hull; the farthest along so many directions
_NO_LIMIT = (-1.5, 1.5)  # rad


class _Joint(NamedTuple):
    parent: str
    child: str
    place: Float64  # (4, 4) of the child in the parent, at rest
    axis: Float64
    limits: tuple[float, float]
    kind: str


class _Robot(NamedTuple):
    hulls: dict[str, Float64]
    joints: tuple[_Joint, ...]


@family(kind=(0, 1.99), reach=(0.2, 1.0))
def robot_arm(rng: np.random.Generator, *, kind: float, reach: float) -> list[Part]:
    """An arm on its base at the origin; `reach` is the share of the joints' range it uses."""
    robot = _read(_ARMS[int(kind)])
    return _posed(robot, rng, reach, robot.joints[0].parent)


@family(opening=(0.0, 1.0))
def robot_gripper(rng: np.random.Generator, *, opening: float) -> list[Part]:
    """The hand of an arm with its two fingers, pointing down, the arm being out of sight."""
    del rng
    robot = _read(_ARMS[0])
    parts = _posed(robot, None, opening, _HAND)
    return moved(parts, rotation(0, np.pi))


def _posed(robot: _Robot, rng: np.random.Generator | None, share: float, root: str) -> list[Part]:
    """The links that hang on a root, each joint somewhere in a share of its range."""
    places = {root: np.eye(4)}
    for joint in robot.joints:
        if joint.parent in places:
            low, high = joint.limits
            at = 0.5 + 0.5 * share * rng.uniform(-1, 1) if rng is not None else share
            motion = _motion(joint, low + at * (high - low))
            places[joint.child] = places[joint.parent] @ joint.place @ motion
    parts: list[Part] = []
    for number, (name, place) in enumerate(places.items()):
        if name in robot.hulls:
            placed = robot.hulls[name] @ place[:3, :3].T + place[:3, 3]
            parts += painted(number % 2, placed)
    return parts


def _motion(joint: _Joint, value: float) -> Float64:
    motion = np.eye(4)
    if joint.kind == "prismatic":
        motion[:3, 3] = value * joint.axis
    elif joint.kind in ("revolute", "continuous"):
        x, y, z = joint.axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        motion[:3, :3] += np.sin(value) * cross + (1 - np.cos(value)) * cross @ cross
    return motion


@lru_cache(maxsize=len(_ARMS))
def _read(name: str) -> _Robot:
    path = data_folder() / name
    tree = ElementTree.parse(path).getroot()
    hulls: dict[str, Float64] = {}
    for link in tree.iter("link"):
        mesh = link.find("visual/geometry/mesh")
        collision = link.find("collision/geometry/mesh")
        for element in (collision, mesh):
            file = "" if element is None else element.get("filename", "")
            if file.endswith(".obj"):
                hulls[link.get("name", "")] = _hull(path.parent / file.removeprefix("package://"))
                break
    joints = tuple(
        _joint(element) for element in tree.iter("joint") if element.find("parent") is not None
    )
    return _Robot(hulls, joints)


def _joint(element: ElementTree.Element) -> _Joint:
    origin, axis, limit = element.find("origin"), element.find("axis"), element.find("limit")
    place = np.eye(4)
    if origin is not None:
        roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"))
        place[:3, :3] = rotation(2, yaw) @ rotation(1, pitch) @ rotation(0, roll)
        place[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
    limits = _NO_LIMIT
    if limit is not None and limit.get("lower"):
        limits = (float(limit.get("lower", 0)), float(limit.get("upper", 0)))
    return _Joint(
        _link(element, "parent"), _link(element, "child"), place,
        np.array([1.0, 0, 0] if axis is None else _numbers(axis.get("xyz", "1 0 0"))),
        limits, element.get("type", "fixed"),
    )  # fmt: skip


def _link(element: ElementTree.Element, role: str) -> str:
    end = element.find(role)
    return "" if end is None else end.get("link", "")


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


def _hull(path: Path) -> Float64:
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    points = np.array([[float(word) for word in line.split()[1:4]] for line in lines
                       if line.startswith("v ")])  # fmt: skip
    corners = points[ConvexHull(points).vertices]
    ahead = np.random.default_rng(0).normal(size=(_MAX_CORNERS, 3))
    return corners[np.unique((corners @ ahead.T).argmax(axis=0))]
