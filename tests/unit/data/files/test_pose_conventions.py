"""Depth images tell which convention the poses of a recording follow."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.core.geometry import inverse, quaternion_from_rotation, rigid
from scenefw.data.files.pose_conventions import check_conventions, converted
from scenefw.data.files.sequences import open_sequence, write_sequence

BOXES = (*STACK, Box((0.2, -0.1, 0.0), (0.3, 0.1, 0.25)), Box((-0.3, 0.1, 0.0), (-0.2, 0.3, 0.15)))
GL = np.diag([1.0, -1.0, -1.0, 1.0])
ROS = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
P3D, UNITY = np.diag([-1.0, -1.0, 1.0, 1.0]), np.diag([1.0, -1.0, 1.0, 1.0])
Y_UP = np.array([[1.0, 0, 0, 0.3], [0, 0, 1, 2], [0, -1, 0, 1], [0, 0, 0, 1]])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A recording on an irregular arc; its poses are right."""
    angles, heights = np.linspace(0, 1.2, 11) ** 1.3, 0.5 + 0.3 * np.sin(np.arange(11))
    cameras = [
        camera_at((0.8 * np.sin(a), -0.8 * np.cos(a), h), size=(80, 60))
        for a, h in zip(angles, heights, strict=True)
    ]
    path = tmp_path_factory.mktemp("recordings") / "right"
    views = [replace(frame_of(c, BOXES), camera=c, labels=None) for c in cameras]
    return write_sequence(path, views, ordered=False)


def units(pose, factor):
    return np.vstack([pose[:3] * [1, 1, 1, factor], pose[3:]])


def with_quaternion(pose):
    w, x, y, z = quaternion_from_rotation(pose[:3, :3])
    return np.array([*pose[:3, 3], w, x, y, z])


CASES = {
    "opengl": lambda pose: pose @ GL,
    "ros": lambda pose: pose @ ROS,
    "pytorch3d": lambda pose: pose @ P3D,
    "world_to_camera": inverse,
    "world_to_camera+opengl": lambda pose: inverse(pose @ GL),
    "quaternion_w_first": with_quaternion,
    "quaternion_w_first+opengl": lambda pose: with_quaternion(pose @ GL),
    "millimetres": lambda pose: units(pose, 1000),
    "centimetres+opengl": lambda pose: units(pose @ GL, 100),
}


def rewritten(tmp_path, folder, poses):
    """The recording with other poses."""
    for name in ("depth", "intrinsics.json"):
        (tmp_path / name).symlink_to(folder / name)
    lines = [" ".join(f"{x:.9f}" for x in np.ravel(pose)) for pose in poses]
    (tmp_path / "poses.txt").write_text("\n".join(lines))
    return tmp_path


@pytest.mark.parametrize(
    ("name", "world"),
    [*((name, np.eye(4)) for name in CASES), ("opengl", Y_UP), ("world_to_camera", Y_UP)],
)
def test_another_convention_is_named_and_then_read(tmp_path, folder, name, world):
    right = [world @ pose for pose in open_sequence(folder).poses]
    path = rewritten(tmp_path, folder, [CASES[name](pose) for pose in right])
    with pytest.raises(InputError, match="contradict its depth images") as caught:
        open_sequence(path, largest_jump=None)
    assert str(caught.value).endswith(f"; set run.poses={name}")
    assert "\n" not in str(caught.value)
    read = open_sequence(path, largest_jump=None, poses=name)
    np.testing.assert_allclose(read.poses, right, atol=1e-5)
    assert not read.notes


@pytest.mark.parametrize("world", [np.eye(4), Y_UP])
def test_right_poses_are_silent_in_any_world(tmp_path, folder, world):
    right = [world @ pose for pose in open_sequence(folder).poses]
    assert not open_sequence(rewritten(tmp_path, folder, right), largest_jump=None).notes


def test_a_convention_that_right_poses_do_not_have_is_named(folder):
    with pytest.raises(InputError, match=r"with poses as documented .* set run\.poses=opencv$"):
        open_sequence(folder, poses="opengl", largest_jump=None)


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (lambda poses: poses[::-1], "poses in the reverse order"),
        (lambda poses: [*poses[1:], poses[-1]], "each pose one image later"),
    ],
)
def test_poses_of_other_images_are_named(tmp_path, folder, order, words):
    path = rewritten(tmp_path, folder, order(open_sequence(folder).poses))
    with pytest.raises(InputError, match=words) as caught:
        open_sequence(path, largest_jump=None)
    assert "begin each line of the poses with its image's name" in str(caught.value)


def test_poses_that_no_convention_explains_are_told(tmp_path, folder):
    rng = np.random.default_rng(1)
    wrong = [pose.copy() for pose in open_sequence(folder).poses]
    for pose in wrong:
        pose[:3, 3] += rng.normal(0, 0.1, 3)
    [note] = open_sequence(rewritten(tmp_path, folder, wrong), largest_jump=None).notes
    assert "neighbouring views agree to" in note
    assert "check poses, intrinsics and depth scale" in note


@pytest.mark.parametrize(
    ("change", "words", "fix"),
    [
        (lambda pose: rigid(pose[:3, :3].T, pose[:3, 3]), "transposed rotations", "transpose the"),
        (lambda pose: UNITY @ pose @ UNITY, "left-handed axes", "negate the second row and column"),
    ],
)
def test_what_no_setting_undoes_is_named(tmp_path, folder, change, words, fix):
    wrong = [change(pose) for pose in open_sequence(folder).poses]
    with pytest.raises(InputError, match=f"with {words}.*{fix}"):
        open_sequence(rewritten(tmp_path, folder, wrong), largest_jump=None)


def test_a_single_wrong_pose_is_named(tmp_path, folder):
    sequence = open_sequence(folder)
    poses, middle = list(sequence.poses), len(sequence.poses) // 2
    poses[middle] = rigid(np.eye(3), (0.0, 0.0, 0.2)) @ poses[middle]
    [note] = open_sequence(rewritten(tmp_path, folder, poses), largest_jump=None).notes
    assert f"depth of {sequence[middle].name} contradicts the views before and after" in note


def test_views_of_different_places_are_told(tmp_path, folder):
    sequence = open_sequence(folder)
    apart = [rigid(np.eye(3), (1.0 * n, 0, 0)) @ p for n, p in enumerate(sequence.poses)]
    [note] = open_sequence(rewritten(tmp_path, folder, apart), largest_jump=None).notes
    assert "don't show the same place" in note


def test_a_camera_that_stands_still_tells_nothing(folder):
    frame, pose = open_sequence(folder)[0], open_sequence(folder).poses[0]
    assert check_conventions([frame] * 3, [pose @ GL] * 3, ["a", "b", "c"], "still") == ()
    assert check_conventions([frame], [pose], ["a"], "single") == ()


@pytest.mark.parametrize("name", ["arkit", "opengl+ros", ""])
def test_unknown_conventions_are_one_line(name):
    with pytest.raises(InputError, match=r"no pose convention .*; expected opencv, or of"):
        converted(np.eye(4), name)
