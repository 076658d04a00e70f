import sys
from dataclasses import replace

import numpy as np
import pytest
from plugins.simulators.tests.test_ros import WALL
from tests.unit.export.stacks import COLOURS, SIZES, stack
from tests.unit.perception.estimate.test_base_frame import POSE

from scenefw.core.errors import MissingDependencyError
from scenefw.core.types import Obstacle
from scenefw.perception.estimate.base_frame import floor_pose, in_base, with_camera_in_base
from scenefw_simulators import usd
from scenefw_simulators.usd import USD

needs_usd = pytest.mark.skipif(
    usd.find_spec("pxr") is None, reason="needs usd-core (pip install 'scenefw[usd]')"
)


def stage_of(folder, estimate):
    from pxr import Usd

    USD().write(folder / "scene.usd", estimate, COLOURS)
    assert [path.name for path in folder.iterdir()] == ["scene.usd"]
    return Usd.Stage.Open(str(folder / "scene.usd"))


@needs_usd
def test_bodies_have_poses_masses_inertia_colours_and_collision_shapes(tmp_path):
    from pxr import UsdGeom, UsdPhysics

    estimate = replace(stack(), obstacles=(Obstacle("wall", WALL),))
    stage = stage_of(tmp_path, estimate)
    assert UsdGeom.GetStageMetersPerUnit(stage) == UsdPhysics.GetStageKilogramsPerUnit(stage) == 1
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    for item, size, colour in zip(estimate.objects, SIZES, COLOURS, strict=True):
        body = stage.GetPrimAtPath(f"/World/object_{item.id:02d}")
        assert body.HasAPI(UsdPhysics.RigidBodyAPI)
        matrix = np.array(UsdGeom.Xformable(body).ComputeLocalToWorldTransform(0)).T
        np.testing.assert_allclose(matrix[:3, 3], item.pose.position, atol=1e-6)
        mass = UsdPhysics.MassAPI(body)
        weight = mass.GetMassAttr().Get()
        assert weight == pytest.approx(500 * np.prod(size), rel=1e-5)
        a, b, c = sorted(size)
        expected = weight / 12 * np.array([a * a + b * b, a * a + c * c, b * b + c * c])
        np.testing.assert_allclose(sorted(mass.GetDiagonalInertiaAttr().Get()), expected, rtol=1e-4)
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"{body.GetPath()}/visual"))
        points = np.array(mesh.GetPointsAttr().Get()) @ matrix[:3, :3].T + matrix[:3, 3]
        np.testing.assert_allclose(points, item.mesh.vertices, atol=1e-5)
        np.testing.assert_allclose(mesh.GetDisplayColorAttr().Get()[0], colour, atol=1e-6)
        touching = stage.GetPrimAtPath(f"{body.GetPath()}/collision_01")
        assert touching.HasAPI(UsdPhysics.CollisionAPI)
        assert UsdGeom.Imageable(touching).ComputePurpose() == "guide"
    wall = stage.GetPrimAtPath("/World/obstacle_01")
    assert wall.HasAPI(UsdPhysics.CollisionAPI)
    assert not wall.HasAPI(UsdPhysics.RigidBodyAPI)


@needs_usd
def test_the_stage_keeps_the_rules_of_usd(tmp_path):
    from pxr import UsdValidation

    stage = stage_of(tmp_path, stack())
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 10
    problems = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [problem.GetMessage() for problem in problems] == []


@needs_usd
def test_in_a_robots_base_floor_and_gravity_follow(tmp_path):
    from pxr import UsdGeom, UsdPhysics

    estimate = in_base(with_camera_in_base(stack(), POSE))
    stage = stage_of(tmp_path, estimate)
    floor = floor_pose(estimate.details)
    plane = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Floor"))
    matrix = np.array(plane.ComputeLocalToWorldTransform(0)).T
    np.testing.assert_allclose(matrix, floor, atol=1e-6)
    scene = UsdPhysics.Scene(stage.GetPrimAtPath("/World/PhysicsScene"))
    np.testing.assert_allclose(scene.GetGravityDirectionAttr().Get(), -floor[:3, 2], atol=1e-6)


def test_without_the_library_the_install_line_is_said(monkeypatch):
    monkeypatch.setattr(usd, "find_spec", lambda name: None)
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'scenefw\[usd\]'"):
        USD()
