"""Predicted objects come to rest: by how much, what moves along, and what stays and why."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from scenefw.core.batches import SceneParameters
from scenefw.core.settled import words
from scenefw.core.types import Camera, Frame, GridSpec, SceneEstimate, TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.postprocessing.surfaces import instance_meshes
from scenefw.representations.volumes import scene_volumes
from scenefw_simulators.body_maker import BodyMaker
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine
from scenefw_simulators.settling import PhysicalSettling

pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")

GRID = GridSpec(resolution=64)
HALF = 0.06  # m, of the cubes


def estimate(*positions):
    """Cubes at these places, as a network says them: meshes of volumes."""
    count = len(positions)
    parameters = SceneParameters(
        torch.full((1, count, 3), HALF),
        torch.full((1, count, 3), 30.0),
        torch.eye(3).expand(1, count, 3, 3).clone(),
        torch.tensor([positions]).float().reshape(1, count, 3),
        torch.ones(1, count, dtype=torch.bool),
    )
    volumes = scene_volumes(parameters, GRID)
    tsdf, instances = volumes.tsdf[0, 0].numpy(), volumes.instances[0].numpy()
    objects = estimate_objects(instance_meshes(tsdf, instances, GRID), {})
    frame = Frame(np.ones((2, 2), np.float32), Camera(2, 2, 2, 2, 0.5, 0.5))
    return SceneEstimate(objects, GRID, tsdf, instances, frame, {"seed": 7})


def settling(**settings):
    return PhysicalSettling(PyBulletEngine(), BodyMaker(), **settings)


def rows(scene):
    return {row["id"]: row for row in scene.details["settled"]["objects"]}


def test_what_floats_comes_down_with_all_that_describes_it():
    before = estimate((0.2, 0, HALF), (-0.1, 0, HALF + 0.05))
    (after,) = settling().settle([before])
    assert rows(after)[1]["moved"] == pytest.approx(0, abs=3e-3)
    assert rows(after)[2]["moved"] == pytest.approx(0.05, abs=3e-3)
    assert rows(after)[2]["collides_as"] == "convex hull"
    fallen = after.objects[1]
    assert fallen.mesh.vertices[:, 2].min() == pytest.approx(0, abs=3e-3)
    np.testing.assert_allclose(fallen.pose.position, [-0.1, 0, HALF], atol=3e-3)
    heights = GRID.centres()[..., 2]
    assert heights[after.instances == 2].min() < GRID.voxel_size
    assert heights[after.instances == 2].mean() == pytest.approx(HALF, abs=5e-3)
    assert (after.instances == 2).sum() == pytest.approx((before.instances == 2).sum(), rel=0.05)
    assert ((after.tsdf < 0) == (after.instances > 0)).all()
    assert after.frame is before.frame
    assert after.details["seed"] == 7
    assert "object 2 moved 5.0 cm" in words(after)


def test_what_falls_far_or_is_no_solid_stays_and_says_why():
    before = estimate((0.2, 0, HALF), (-0.1, 0, HALF + 0.3))
    opened = before.objects[0].mesh
    opened = TriangleMesh(opened.vertices, opened.faces[1:])
    before = replace(before, objects=(replace(before.objects[0], mesh=opened), before.objects[1]))
    (after,) = settling().settle([before])
    assert rows(after)[1] == {"id": 1, "stays": "its surface is not closed"}
    assert rows(after)[2]["stays"] == "it moved further than 0.2 m"
    assert after.objects == before.objects
    assert not after.details["settled"]["stable"]
    assert "object 1 stays as it was (its surface is not closed)" in words(after)


def test_nothing_to_settle_is_said():
    (after,) = settling().settle([estimate()])
    assert after.details["settled"]["reason"] == "there is no solid to settle"
    assert words(after) == "settled: there is no solid to settle"


def test_hypotheses_keep_their_order():
    scenes = [estimate((0, 0, HALF + 0.1)), estimate()]
    found = settling().settle(scenes)
    assert [one.details["settled"]["hypothesis"] for one in found] == [1, 2]
