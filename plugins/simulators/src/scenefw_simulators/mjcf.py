"""MJCF: a scene for MuJoCo in one file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from scenefw.core.files import write_text
from scenefw.core.types import Pose
from scenefw.perception.estimate.base_frame import floor_pose
from scenefw_simulators.bodies import DENSITY, Body, BodyMaker
from scenefw_simulators.xml_files import numbers, rgba, xml_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import CollisionShapes
    from scenefw.core.types import SceneEstimate, TriangleMesh
    from scenefw.export.meshes import Colour

_SEEN, _TOUCHING = "2", "3"  # groups of geoms; viewers hide 3


class MJCF:
    """MJCF with meshes, collision shapes, masses and inertias; nothing lies beside the file.

    Every object is a free body at its pose, on a floor at z = 0. What is seen is in group 2 of the
    geoms, what touches in group 3.

    Args:
        density: of every object (kg/m^3).
        collision: says what touches; None = one convex hull each.

    Raises:
        ConfigError: a density that isn't positive.
    """

    suffix = ".xml"

    def __init__(self, density: float = DENSITY, collision: CollisionShapes | None = None) -> None:
        self._maker = BodyMaker(density, collision)

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the file.

        Raises:
            InputError: an object has no volume.
            StorageError: the file can't be written.
        """
        root = ET.Element("mujoco", model=path.stem)
        defaults = ET.SubElement(root, "default")
        for name, changes in (
            ("seen", {"contype": "0", "conaffinity": "0", "group": _SEEN}),
            ("touching", {"group": _TOUCHING}),
        ):
            of_class = ET.SubElement(defaults, "default", {"class": name})
            ET.SubElement(of_class, "geom", {"type": "mesh", **changes})
        assets, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
        ET.SubElement(world, "light", pos="0 0 3", dir="0 0 -1", directional="true")
        floor = Pose.from_matrix(floor_pose(estimate.details))
        place = {"pos": numbers(floor.position), "quat": numbers(floor.quaternion)}
        plane = {"name": "floor", "type": "plane", "size": "2 2 0.1", "rgba": ".9 .9 .9 1"}
        ET.SubElement(world, "geom", {**plane, **place})
        for body, colour in zip(self._maker.bodies(estimate), colours, strict=True):
            _add(assets, world, body, colour)
        write_text(path, xml_text(root))


def _add(assets: ET.Element, world: ET.Element, body: Body, colour: Colour) -> None:
    place, turn = numbers(body.pose.position), numbers(body.pose.quaternion)
    node = ET.SubElement(world, "body", name=body.name, pos=place, quat=turn)
    ET.SubElement(node, "freejoint", name=f"{body.name}_free")
    inertia = [body.inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    ET.SubElement(
        node, "inertial", pos="0 0 0", mass=numbers([body.mass]), fullinertia=numbers(inertia)
    )
    _add_mesh(assets, f"{body.name}_seen", body.mesh)
    visual = {"class": "seen", "mesh": f"{body.name}_seen", "rgba": rgba(colour)}
    ET.SubElement(node, "geom", visual)
    for i, part in enumerate(body.collision, start=1):
        name = f"{body.name}_touching_{i}"
        _add_mesh(assets, name, part)
        ET.SubElement(node, "geom", {"class": "touching", "mesh": name})


def _add_mesh(assets: ET.Element, name: str, mesh: TriangleMesh) -> None:
    faces = " ".join(map(str, mesh.faces.ravel().tolist()))
    ET.SubElement(assets, "mesh", name=name, vertex=numbers(mesh.vertices.ravel()), face=faces)
