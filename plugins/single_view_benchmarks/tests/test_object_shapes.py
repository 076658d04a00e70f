"""Scores of shapes against spheres and boxes, whose distances and volumes have formulas."""

import numpy as np
import pytest
import trimesh

from scenefw.core.types import Camera, TriangleMesh
from scenefw_single_view_benchmarks.object_shapes import SolidShape, shape_scores, visible_points

VOXEL = 0.004


def solid(mesh):
    return SolidShape(TriangleMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)), VOXEL)


def sphere(radius, centre=(0.0, 0.0, 0.0)):
    mesh = trimesh.creation.icosphere(4, radius)
    return solid(mesh.apply_translation(centre))


def test_a_shape_is_itself():
    shape, seen = sphere(0.05), np.arange(2000) % 2 == 0
    scores = shape_scores(shape, sphere(0.05), seen)
    assert max(scores.chamfer, scores.chamfer_visible, scores.chamfer_hidden) < 1e-6
    assert scores[3:] == pytest.approx((1.0, 1.0, 1.0, 1.0))


@pytest.mark.parametrize(("gap", "f_5", "f_10"), [(0.003, 1, 1), (0.007, 0, 1), (0.02, 0, 0)])
def test_concentric_spheres_are_as_far_apart_as_their_radii(gap, f_5, f_10):
    scores = shape_scores(sphere(0.05 + gap), sphere(0.05), np.ones(2000, dtype=bool))
    assert scores.chamfer == pytest.approx(gap, abs=1.5e-4)  # facets lie inside the sphere
    assert scores.chamfer_visible == pytest.approx(gap, abs=1.5e-4)
    assert np.isnan(scores.chamfer_hidden)
    assert (scores.f_5, scores.f_10) == (f_5, f_10)
    ratio = ((0.05 + gap) / 0.05) ** 3
    assert scores.size_ratio == pytest.approx(ratio, rel=1e-6)
    assert scores.iou == pytest.approx(1 / ratio, abs=0.02)


def test_an_error_behind_is_one_of_the_hidden_surface():
    true = solid(trimesh.creation.box((0.1, 0.1, 0.1)))
    longer = trimesh.creation.box((0.1, 0.12, 0.1)).apply_translation((0, 0.01, 0))
    seen = true.points[:, 1] < 0.049  # all but the side that is off by 20 mm
    scores = shape_scores(solid(longer), true, seen)
    assert scores.chamfer_visible < 0.001 < 0.01 < scores.chamfer_hidden
    assert scores.iou == pytest.approx(1 / 1.2, abs=0.04)  # a voxel is 4 mm


def test_distances_are_the_same_both_ways_and_from_fewer_points():
    first, second = sphere(0.05), solid(trimesh.creation.box((0.09, 0.09, 0.09)))
    assert first.distance(second) == pytest.approx(second.distance(first))
    assert first.distance(second, 400) == pytest.approx(first.distance(second), rel=0.1)
    far = sphere(0.05, (0.3, 0, 0))
    assert first.iou(far) == 0
    assert shape_scores(far, first, np.zeros(2000, dtype=bool)).f_10 == 0


def test_a_camera_sees_the_cap_of_a_sphere():
    radius, away = 0.05, 0.5
    shape = sphere(radius, (0, 0, away))
    camera = Camera()
    everywhere = np.ones((camera.height, camera.width), dtype=bool)
    seen = visible_points(shape, everywhere, camera)
    assert seen.mean() == pytest.approx((1 - radius / away) / 2, abs=0.02)
    assert shape.points[seen, 2].max() < away
    assert not visible_points(shape, ~everywhere, camera).any()
    left = everywhere.copy()
    left[:, camera.width // 2 :] = False
    assert shape.points[visible_points(shape, left, camera), 0].max() < 0.002
