import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.unit.perception.edited_scenes import scene

from scenefw.core.errors import InputError
from scenefw.core.geometry import rigid, transform_points
from scenefw.core.types import Obstacle, TriangleMesh
from scenefw.data.files.camera_pose import camera_pose_of
from scenefw.export.scene_folder import write_scene_files
from scenefw.export.summary import summarise
from scenefw.perception.estimate.base_frame import (
    floor_pose,
    in_base,
    on_floor,
    with_camera_in_base,
)
from scenefw_editing.stored_scenes import read_scene

TURN = Rotation.from_euler("xyz", [170, 20, -65], degrees=True)
POSE = rigid(TURN.as_matrix(), np.array([0.4, -0.2, 0.9]))


@pytest.fixture
def estimate():
    made = scene()
    wall = TriangleMesh(
        np.array([[0, 0.4, 0], [0.3, 0.4, 0], [0, 0.4, 0.3]]), np.array([[0, 1, 2]])
    )
    return replace(made, obstacles=(Obstacle("wall", wall),))


def test_everything_keeps_its_place_in_front_of_the_camera(estimate):
    moved = in_base(with_camera_in_base(estimate, POSE))
    np.testing.assert_allclose(moved.frame.camera.T_world_camera, POSE)

    def in_camera(scene, points):
        return transform_points(np.linalg.inv(scene.frame.camera.T_world_camera), points)

    pairs = [(a.mesh, b.mesh) for a, b in zip(estimate.objects, moved.objects, strict=True)]
    pairs += [(a.mesh, b.mesh) for a, b in zip(estimate.obstacles, moved.obstacles, strict=True)]
    for before, after in pairs:
        np.testing.assert_allclose(
            in_camera(estimate, before.vertices), in_camera(moved, after.vertices), atol=1e-9
        )
    for before, after in zip(estimate.objects, moved.objects, strict=True):
        expected = POSE @ np.linalg.inv(estimate.frame.camera.T_world_camera) @ before.pose.matrix
        np.testing.assert_allclose(after.pose.matrix, expected, atol=1e-9)
        if before.placed is not None:
            np.testing.assert_allclose(after.placed.mesh().vertices, after.mesh.vertices, atol=1e-6)


def test_without_a_pose_nothing_changes(estimate):
    assert with_camera_in_base(estimate, None) is estimate
    assert in_base(estimate) is estimate
    np.testing.assert_array_equal(floor_pose(estimate.details), np.eye(4))


def test_a_scene_in_the_base_is_read_back_on_its_floor(estimate, tmp_path):
    moved = in_base(with_camera_in_base(estimate, POSE))
    write_scene_files(tmp_path, moved, [(1, 0, 0)] * 3)
    read = read_scene(tmp_path)
    for before, after in zip(estimate.objects, read.objects, strict=True):
        np.testing.assert_allclose(after.mesh.vertices, before.mesh.vertices, atol=1e-6)
    again = in_base(read)
    np.testing.assert_allclose(
        again.objects[0].pose.matrix, moved.objects[0].pose.matrix, atol=1e-6
    )
    np.testing.assert_allclose(
        again.obstacles[0].mesh.vertices, moved.obstacles[0].mesh.vertices, atol=1e-6
    )


def test_what_stands_on_what_does_not_depend_on_the_base(estimate):
    moved = in_base(with_camera_in_base(estimate, POSE))
    graph = summarise(estimate, {})["support_graph"]
    assert summarise(moved, {})["support_graph"] == graph
    assert [item["stands_on"] for item in graph["objects"]] == [[0], [1], [0]]
    assert graph["removal_order"][0] == 2
    for before, after in zip(estimate.objects, on_floor(moved), strict=True):
        np.testing.assert_allclose(after.mesh.vertices, before.mesh.vertices, atol=1e-9)


def test_a_pose_is_read_however_it_is_written(tmp_path):
    x, y, z, w = TURN.as_quat()
    written = {
        "a.txt": " ".join(str(v) for v in POSE.ravel()),
        "b.txt": "\n".join(" ".join(str(v) for v in row) for row in POSE[:3]),
        "c.txt": f"0.4 -0.2 0.9 {x} {y} {z} {w}",
        "d.json": f'{{"T_base_camera": {POSE.tolist()}}}',
        "e.json": str(POSE.tolist()),
        "f.yaml": f"transform:\n  translation: {{x: 0.4, y: -0.2, z: 0.9}}\n"
        f"  rotation: {{x: {x}, y: {y}, z: {z}, w: {w}}}\n",
    }
    for name, text in written.items():
        (tmp_path / name).write_text(text)
        np.testing.assert_allclose(camera_pose_of(tmp_path / name), POSE, atol=1e-9)
    np.testing.assert_allclose(camera_pose_of(POSE), POSE, atol=1e-9)
    np.testing.assert_allclose(camera_pose_of([0.4, -0.2, 0.9, x, y, z, w]), POSE, atol=1e-9)
    assert camera_pose_of(None) is None


@pytest.mark.parametrize(
    "wrong", ["nowhere.txt", [1, 2, 3], 2 * np.eye(4), ["a"] * 16, np.full((4, 4), np.nan)]
)
def test_what_is_no_pose_is_one_line(wrong):
    with pytest.raises(InputError):
        camera_pose_of(wrong)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda pose: pose, None),
        (np.linalg.inv, "with poses from world to camera it would be level"),
        (
            lambda pose: pose @ np.diag([1.0, -1, -1, 1]),
            "camera axes of OpenGL.* it would be level",
        ),
        (lambda pose: rigid(pose[:3, :3], 1000 * pose[:3, 3]), "m from the base; give metres"),
    ],
)
def test_a_pose_that_contradicts_the_table_is_told(estimate, wrong, words):
    turned = rigid(
        Rotation.from_euler("z", 40, degrees=True).as_matrix(), np.array([0.3, 0.2, 0.5])
    )
    pose = turned @ estimate.frame.camera.T_world_camera
    warnings = with_camera_in_base(estimate, wrong(pose)).details["warnings"]
    assert warnings[0] == "a line"  # of the image
    assert len(warnings[1:]) == (words is not None)
    assert words is None or re.search(words, warnings[1])
