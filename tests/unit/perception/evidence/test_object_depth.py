"""Depth of a box, beside the slabs between its planes."""

from dataclasses import replace

import numpy as np
import open3d
import pytest
import trimesh
from tests.unit.perception.estimate.test_plausibility import solid
from tests.unit.perception.synthetic import camera_at

from scenefw.core.types import TriangleMesh
from scenefw.perception.evidence.object_depth import object_depth
from scenefw.perception.observation.pixels import coarse_step

LOW, HIGH = np.array((-0.05, -0.04, 0.0)), np.array((0.05, 0.06, 0.12))


@pytest.mark.parametrize("size", [(160, 120), (640, 480)])
def test_rays_enter_and_leave_where_slabs_say(size):
    camera = camera_at(eye=(0.3, -0.8, 0.6), size=size)
    depth = object_depth(solid(LOW, HIGH), camera)
    step = coarse_step(camera.width)
    x, y = (np.arange(0, length, step) for length in size)
    x, y = np.meshgrid((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ camera.T_world_camera[:3, :3].T
    crossings = (np.stack([LOW, HIGH])[:, None, None] - camera.T_world_camera[:3, 3]) / rays
    enter, leave = crossings.min(axis=0).max(axis=-1), crossings.max(axis=0).min(axis=-1)
    through = leave - enter > 1e-3  # through an edge rounding decides
    front, back = np.zeros(through.shape), np.zeros(through.shape)
    front[depth.box], back[depth.box] = depth.front, depth.back
    assert 50 < through.sum() < through.size / 4
    np.testing.assert_allclose(front[through], enter[through], atol=1e-5)
    np.testing.assert_allclose(back[through], leave[through], atol=1e-5)
    assert not front[leave < enter].any()
    assert not back[leave < enter].any()


def test_the_same_mesh_before_the_same_camera_is_cast_once():
    mesh, camera = solid(LOW, HIGH), camera_at(eye=(0.3, -0.8, 0.6), size=(160, 120))
    depth = object_depth(mesh, camera)
    rounded = replace(camera, T_world_camera=np.float64(np.float32(camera.T_world_camera)))
    assert object_depth(mesh, rounded) is depth  # as kernels hold it
    assert object_depth(mesh, camera_at(eye=(0.3, -0.8, 0.7), size=(160, 120))) is not depth
    assert object_depth(solid(LOW, HIGH), camera) is not depth


@pytest.mark.parametrize("eye", [(0.3, 5.0, 0.6), (0.0, 0.01, 0.06)])
def test_what_is_beside_or_about_the_camera_is_no_error(eye):
    camera = camera_at(eye=(0.3, -0.8, 0.6), size=(160, 120))
    pose = camera.T_world_camera.copy()
    pose[:3, 3] = eye
    depth = object_depth(solid(LOW, HIGH), camera.__class__(160, 120, 150, 150, 79.5, 59.5, pose))
    assert depth.front.shape == depth.back.shape


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_a_ring_is_entered_and_left_where_a_ray_caster_says(size):
    torus = trimesh.creation.torus(0.1, 0.04, major_sections=24, minor_sections=12)
    camera = camera_at(eye=(0.3, -0.5, 0.3), size=size)
    depth = object_depth(TriangleMesh(np.array(torus.vertices), np.array(torus.faces)), camera)
    step = coarse_step(camera.width)
    x, y = (np.arange(0, length, step) for length in size)
    x, y = np.meshgrid((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ camera.T_world_camera[:3, :3].T
    eye = np.broadcast_to(camera.T_world_camera[:3, 3], rays.shape)
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(np.float32(torus.vertices), np.uint32(torus.faces))
    crossings = scene.list_intersections(np.float32(np.concatenate([eye, rays], axis=-1)))
    counts = scene.count_intersections(np.float32(np.concatenate([eye, rays], axis=-1))).numpy()
    distances, splits = crossings["t_hit"].numpy(), crossings["ray_splits"].numpy()
    expected = np.zeros((2, counts.size))
    for pixel in np.flatnonzero(counts.ravel() >= 2):
        expected[:, pixel] = np.sort(distances[splits[pixel] : splits[pixel + 1]])[:2]
    front, back = np.zeros((2, *counts.shape))
    front[depth.box], back[depth.box] = depth.front, depth.back
    assert (counts == 4).sum() > 20  # through both sides
    through = (expected[1] - expected[0]).reshape(counts.shape) > 1e-3
    for values, known in zip((front, back), expected.reshape(2, *counts.shape), strict=True):
        np.testing.assert_allclose(values[through], known[through], atol=1e-5)
    assert (front[counts == 0] == 0).all()
