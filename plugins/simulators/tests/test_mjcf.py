from xml.etree import ElementTree as ET

import numpy as np
import pytest
from tests.unit.export.stacks import COLOURS, SIZES, moved, stack

from scenefw_simulators.mjcf import MJCF


def written(folder, estimate, **settings):
    MJCF(**settings).write(folder / "scene.xml", estimate, COLOURS)
    return folder / "scene.xml"


def numbers(text):
    return np.array([float(word) for word in text.split()])


def test_a_body_per_object_with_mass_inertia_and_meshes(tmp_path):
    estimate = stack()
    root = ET.parse(written(tmp_path, estimate)).getroot()
    assert [path.name for path in tmp_path.iterdir()] == ["scene.xml"]
    meshes = {mesh.get("name"): mesh for mesh in root.find("asset")}
    bodies = root.findall("worldbody/body")
    assert [body.get("name") for body in bodies] == ["object_01", "object_02", "object_03"]
    for body, item, size in zip(bodies, estimate.objects, SIZES, strict=True):
        np.testing.assert_allclose(numbers(body.get("pos")), item.pose.position, atol=1e-8)
        np.testing.assert_allclose(numbers(body.get("quat")), item.pose.quaternion, atol=1e-8)
        assert body.find("freejoint") is not None
        mass = float(body.find("inertial").get("mass"))
        assert mass == pytest.approx(500 * np.prod(size), rel=1e-6)
        inertia = numbers(body.find("inertial").get("fullinertia"))
        a, b, c = sorted(size)
        expected = mass / 12 * np.array([a * a + b * b, a * a + c * c, b * b + c * c])
        np.testing.assert_allclose(sorted(inertia[:3]), expected, rtol=1e-5)
        np.testing.assert_allclose(inertia[3:], 0, atol=1e-9)
        assert {geom.get("class") for geom in body.findall("geom")} == {"seen", "touching"}
        for geom in body.findall("geom"):
            vertices = numbers(meshes[geom.get("mesh")].get("vertex")).reshape(-1, 3)
            np.testing.assert_allclose(sorted(np.ptp(vertices, axis=0)), sorted(size), atol=1e-6)
            faces = numbers(meshes[geom.get("mesh")].get("face"))
            assert faces.max() == len(vertices) - 1
    classes = {one.get("class"): one.find("geom") for one in root.find("default")}
    assert classes["seen"].get("contype") == classes["seen"].get("conaffinity") == "0"


@pytest.mark.parametrize(("shift", "stays"), [(0.0, True), (0.075, False)])
def test_a_stack_stays_put_if_it_can(tmp_path, shift, stays):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(written(tmp_path, stack(shift))))
    data = mujoco.MjData(model)
    before = data.qpos.reshape(-1, 7).copy()
    while data.time < 2:
        mujoco.mj_step(model, data)
    after = data.qpos.reshape(-1, 7)
    way, angle = moved(*([(row[:3], row[3:]) for row in rows] for rows in (before, after)))
    assert (way < 0.003 and angle < 1.0) == stays
