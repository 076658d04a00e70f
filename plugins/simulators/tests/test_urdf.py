from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import trimesh
from tests.unit.export.stacks import COLOURS, SIZES, moved, stack

from scenefw.core.errors import ConfigError
from scenefw_simulators.urdf import URDF

pybullet = pytest.importorskip("pybullet", reason="pip install 'scenefw[simulation]'")


@pytest.fixture
def bullet():
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    floor = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    pybullet.createMultiBody(0, floor, physicsClientId=client)
    yield client
    pybullet.disconnect(client)


def written(folder, estimate, **settings):
    URDF(**settings).write(folder / "scene.urdf", estimate, COLOURS)
    return ET.parse(folder / "scene.urdf").getroot()


def loaded(client, folder, scene):
    """Bodies of PyBullet at the poses that the scene's file tells."""
    bodies = []
    for joint in scene.iter("joint"):
        assert joint.get("type") == "floating"
        origin, name = joint.find("origin"), joint.find("child").get("link")
        xyz, rpy = ([float(x) for x in origin.get(key).split()] for key in ("xyz", "rpy"))
        file, turn = folder / "scene_urdf" / f"{name}.urdf", pybullet.getQuaternionFromEuler(rpy)
        bodies.append(
            pybullet.loadURDF(
                str(file),
                xyz,
                turn,
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
                physicsClientId=client,
            )
        )
    return bodies


def poses(client, bodies):
    found = [pybullet.getBasePositionAndOrientation(b, physicsClientId=client) for b in bodies]
    return [(position, (q[3], *q[:3])) for position, q in found]


@pytest.mark.parametrize(("shift", "stays"), [(0.0, True), (0.075, False)])
def test_a_stack_stays_put_if_it_can(tmp_path, bullet, shift, stays):
    estimate = stack(shift)
    bodies = loaded(bullet, tmp_path, written(tmp_path, estimate))
    told = [(item.pose.position, item.pose.quaternion) for item in estimate.objects]
    way, angle = moved(told, poses(bullet, bodies))
    assert way < 1e-6
    assert angle < 1e-3
    for _ in range(480):  # 2 s
        pybullet.stepSimulation(physicsClientId=bullet)
    way, angle = moved(told, poses(bullet, bodies))
    assert (way < 0.006 and angle < 1.0) == stays  # PyBullet puts a margin of 1 mm around hulls


def test_masses_and_inertias_are_those_of_boxes(tmp_path, bullet):
    bodies = loaded(bullet, tmp_path, written(tmp_path, stack(), density=800.0))
    for body, size in zip(bodies, SIZES, strict=True):
        mass, _, diagonal, *_ = pybullet.getDynamicsInfo(body, -1, physicsClientId=bullet)
        assert mass == pytest.approx(800 * np.prod(size), rel=1e-6)
        a, b, c = sorted(size)
        expected = mass / 12 * np.array([a * a + b * b, a * a + c * c, b * b + c * c])
        np.testing.assert_allclose(sorted(diagonal), expected, rtol=1e-5)


def test_a_scene_of_fewer_objects_leaves_no_file_of_the_others(tmp_path):
    whole = stack()
    written(tmp_path, whole)
    one = replace(whole, objects=whole.objects[:1])
    URDF().write(tmp_path / "scene.urdf", one, COLOURS[:1])
    assert {path.name.partition(".")[0] for path in (tmp_path / "scene_urdf").glob("[!.]*")} == {
        "object_01",
        "object_01_collision_1",
    }


def test_files_lie_together_and_hold_the_shapes(tmp_path):
    scene = written(tmp_path, stack())
    names = [mesh.get("filename") for mesh in scene.iter("mesh")]
    assert sorted(set(names)) == sorted(
        f"scene_urdf/object_{i:02d}{part}.obj" for i in (1, 2, 3) for part in ("", "_collision_1")
    )
    for name, size in zip(sorted(names)[1::2], SIZES, strict=True):
        mesh = trimesh.load(tmp_path / name)
        assert mesh.is_watertight
        assert mesh.is_convex
        assert mesh.volume == pytest.approx(np.prod(size), rel=1e-4)
    assert next(scene.iter("link")).get("name") == "world"
    colours = [color.get("rgba") for color in scene.iter("color")]
    assert colours[1] == "0.9 0.6 0 1"


def test_a_density_is_positive():
    with pytest.raises(ConfigError, match="density is 0"):
        URDF(density=0)
