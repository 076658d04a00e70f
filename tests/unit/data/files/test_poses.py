import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw.core.geometry import look_at
from scenefw.data.files.poses import pose_of, read_numbers, write_poses

POSE = look_at((0.3, -0.2, 0.5), (0.0, 0.0, 0.0))


def test_a_byte_order_mark_is_no_number(tmp_path):
    path = tmp_path / "poses.txt"
    write_poses(path, [POSE, POSE])
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    poses = [pose_of(words, "a line") for words in read_numbers(path)]
    np.testing.assert_allclose(poses, [POSE, POSE], atol=1e-8)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirrored_pose_is_refused_and_one_with_two_axes_turned_is_not(axis):
    mirrored = POSE.copy()
    mirrored[:3, axis] *= -1
    with pytest.raises(InputError, match=r"^line 3 is a mirror image \(determinant -1\)"):
        pose_of([str(value) for value in mirrored.ravel()], "line 3")
    mirrored[:3, (axis + 1) % 3] *= -1
    found = pose_of([str(value) for value in mirrored.ravel()], "line 3")
    np.testing.assert_allclose(found, mirrored)
