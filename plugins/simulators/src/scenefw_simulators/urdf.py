"""URDF: robots' description files, one per object and one of the scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from scenefw.core.files import write_text
from scenefw.core.folders import replacing_folder
from scenefw.export.scene_files import obj_lines
from scenefw_simulators.bodies import DENSITY, Body, BodyMaker
from scenefw_simulators.xml_files import numbers, rgba, xml_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import CollisionShapes
    from scenefw.core.types import Float64, SceneEstimate, TriangleMesh
    from scenefw.export.meshes import Colour


class URDF:
    """URDF with meshes, collision shapes, masses and inertias.

    `scene.urdf` has a link `world` and a floating joint to each object, whose origin is its pose.
    PyBullet and others fix floating joints; for them the folder `scene_urdf` has a file of each
    object, `object_01.urdf`, to be loaded at that pose. Meshes are OBJ in the same folder.

    Args:
        density: of every object (kg/m^3).
        collision: says what touches; None = one convex hull each.

    Raises:
        ConfigError: a density that isn't positive.
    """

    suffix = ".urdf"

    def __init__(self, density: float = DENSITY, collision: CollisionShapes | None = None) -> None:
        self._maker = BodyMaker(density, collision)

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the scene's file and the folder.

        Raises:
            InputError: an object has no volume.
            StorageError: a file can't be written.
        """
        scene = ET.Element("robot", name=path.stem)
        ET.SubElement(scene, "link", name="world")
        with replacing_folder(path.with_name(f"{path.stem}_urdf")) as folder:
            for body, colour in zip(self._maker.bodies(estimate), colours, strict=True):
                _write_meshes(folder, body)
                robot = ET.Element("robot", name=body.name)
                _add_link(robot, body, colour, "")
                write_text(folder / f"{body.name}.urdf", xml_text(robot))
                _add_link(scene, body, colour, f"{folder.name}/")
                _add_joint(scene, body)
        write_text(path, xml_text(scene))


def _add_joint(scene: ET.Element, body: Body) -> None:
    joint = ET.SubElement(scene, "joint", name=f"world_to_{body.name}", type="floating")
    xyz, rpy = numbers(body.pose.position), numbers(_roll_pitch_yaw(body.pose.rotation))
    ET.SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    ET.SubElement(joint, "parent", link="world")
    ET.SubElement(joint, "child", link=body.name)


def _write_meshes(folder: Path, body: Body) -> None:
    for name, mesh in _files(body).items():
        write_text(folder / name, "\n".join(["# metres", *obj_lines(mesh)]) + "\n")


def _files(body: Body) -> dict[str, TriangleMesh]:
    """Meshes by file; what is seen comes first."""
    parts = {f"{body.name}_collision_{i}.obj": m for i, m in enumerate(body.collision, start=1)}
    return {f"{body.name}.obj": body.mesh, **parts}


def _add_link(robot: ET.Element, body: Body, colour: Colour, folder: str) -> None:
    link = ET.SubElement(robot, "link", name=body.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "mass", value=numbers([body.mass]))
    entries = {
        f"i{a}{b}": numbers([body.inertia[i, j]])
        for i, a in enumerate("xyz")
        for j, b in enumerate("xyz")
        if i <= j
    }
    ET.SubElement(inertial, "inertia", entries)
    visual_file, *collision_files = _files(body)
    visual = ET.SubElement(link, "visual")
    ET.SubElement(ET.SubElement(visual, "geometry"), "mesh", filename=folder + visual_file)
    material = ET.SubElement(visual, "material", name=f"{body.name}_colour")
    ET.SubElement(material, "color", rgba=rgba(colour))
    for name in collision_files:
        shape = ET.SubElement(ET.SubElement(link, "collision"), "geometry")
        ET.SubElement(shape, "mesh", filename=folder + name)


def _roll_pitch_yaw(rotation: Float64) -> Float64:
    """Angles of R = Rz(yaw) Ry(pitch) Rx(roll), in radians."""
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    if np.cos(pitch) < 1e-6:  # yaw and roll turn about one axis: roll alone
        roll, yaw = np.arctan2(-rotation[1, 2], rotation[1, 1]), 0.0
    else:
        roll = np.arctan2(rotation[2, 1], rotation[2, 2])
        yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    return np.array([roll, pitch, yaw])
