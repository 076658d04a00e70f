from dataclasses import replace

import numpy as np
import pytest
import trimesh
from tests.unit.perception.edited_scenes import CAMERA, scene
from tests.unit.perception.estimate.test_base_frame import POSE

from scenefw.core.geometry import transform_points
from scenefw.export.meshes import write_glb
from scenefw.export.scene_files import OBJ, PLY
from scenefw.export.surface_colours import surface_colours
from scenefw.perception.estimate.base_frame import in_base, with_camera_in_base

OWN = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]


@pytest.fixture
def estimate():
    """Objects whose every pixel is known, the left half of the image dark, the right one light."""
    made = scene()
    image = np.full((48, 64, 3), 40, np.uint8)
    image[:, 32:] = 200
    masks = np.zeros((48, 64), np.int32)
    for item in reversed(made.objects):
        u, v = pixels(item.mesh.vertices)
        masks[v.min() : v.max() + 1, u.min() : u.max() + 1] = item.id
    return replace(made, masks=masks, frame=replace(made.frame, colour=image))


def pixels(points):
    x, y, z = transform_points(np.linalg.inv(CAMERA.T_world_camera), points).T
    u = np.rint(CAMERA.fx * x / z + CAMERA.cx).astype(int)
    return u, np.rint(CAMERA.fy * y / z + CAMERA.cy).astype(int)


def test_what_faces_the_camera_has_the_colour_of_its_pixel(estimate):
    first = surface_colours(estimate, OWN)[0]
    mesh = estimate.objects[0].mesh
    front = mesh.vertices[:, 1] < -0.079  # the side towards the camera
    u, _ = pixels(mesh.vertices)
    np.testing.assert_allclose(first[front & (u < 31)], 40 / 255)
    np.testing.assert_allclose(first[front & (u > 33)], 200 / 255)


def test_what_is_hidden_has_the_colour_of_what_is_nearest(estimate):
    first = surface_colours(estimate, OWN)[0]
    mesh = estimate.objects[0].mesh
    back = mesh.vertices[:, 1] > 0.079
    np.testing.assert_allclose(first[back & (mesh.vertices[:, 0] < -0.05)], 40 / 255)
    np.testing.assert_allclose(first[back & (mesh.vertices[:, 0] > 0.05)], 200 / 255)


def test_an_object_that_no_pixel_shows_keeps_its_own_colour(estimate):
    masks = np.where(estimate.masks == 2, 0, estimate.masks)
    assert surface_colours(replace(estimate, masks=masks), OWN)[1] == OWN[1]


def test_without_colour_or_masks_objects_keep_their_own(estimate):
    grey = replace(estimate, frame=replace(estimate.frame, colour=None))
    assert surface_colours(grey, OWN) == OWN
    assert surface_colours(replace(estimate, masks=None), OWN) == OWN


def test_colours_do_not_depend_on_the_frame(estimate):
    moved = in_base(with_camera_in_base(estimate, POSE))
    here, there = surface_colours(estimate, OWN), surface_colours(moved, OWN)
    for before, after in zip(here, there, strict=True):
        assert (np.asarray(before) != np.asarray(after)).any(axis=-1).mean() < 0.02  # at borders


def test_files_carry_them(estimate, tmp_path):
    expected = surface_colours(estimate, OWN)[0]
    write_glb(tmp_path / "scene.glb", estimate, OWN)
    loaded = trimesh.load(tmp_path / "scene.glb").geometry["object_01"]
    stored = np.asarray(loaded.visual.vertex_attributes["color"])[:, 0] / 255
    np.testing.assert_allclose(stored, ((expected[:, 0] + 0.055) / 1.055) ** 2.4, atol=0.01)
    PLY().write(tmp_path / "scene.ply", estimate, OWN)
    loaded = trimesh.load(tmp_path / "scene.ply", process=False)
    count = len(expected)
    np.testing.assert_allclose(loaded.visual.vertex_colors[:count, :3] / 255, expected, atol=0.01)
    OBJ().write(tmp_path / "scene.obj", estimate, OWN)
    first = next(line for line in (tmp_path / "scene.obj").open() if line.startswith("v "))
    np.testing.assert_allclose([float(x) for x in first.split()[4:]], expected[0], atol=1e-3)
