import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from scenefw.core import geometry

seeds = st.integers(0, 2**32 - 1)
vectors = arrays(np.float64, 3, elements=st.floats(-5, 5)).filter(
    lambda v: np.linalg.norm(v) > 1e-3
)


def quaternion(seed):
    return geometry.random_quaternion(np.random.default_rng(seed))


@given(seeds)
def test_quaternions_mean_the_rotations_that_scipy_says(seed):
    w, x, y, z = q = quaternion(seed)
    expected = Rotation.from_quat([x, y, z, w]).as_matrix()
    np.testing.assert_allclose(geometry.rotation_from_quaternion(q), expected, atol=1e-12)


@given(seeds)
def test_rotation_and_quaternion_are_inverse(seed):
    q = quaternion(seed)
    assert q[0] >= 0
    back = geometry.quaternion_from_rotation(geometry.rotation_from_quaternion(q))
    np.testing.assert_allclose(back * np.sign(back @ q), q, atol=1e-7)
    assert back[0] >= 0


def test_quaternions_come_in_batches():
    batch = np.stack([quaternion(i) for i in range(6)]).reshape(2, 3, 4)
    rotations = geometry.rotation_from_quaternion(batch)
    assert rotations.shape == (2, 3, 3, 3)
    np.testing.assert_allclose(rotations[1, 2], geometry.rotation_from_quaternion(batch[1, 2]))


def test_random_quaternions_turn_a_vector_anywhere():
    rng = np.random.default_rng(0)
    turned = np.stack(
        [
            geometry.rotation_from_quaternion(geometry.random_quaternion(rng))[:, 2]
            for _ in range(4000)
        ]
    )
    np.testing.assert_allclose(turned.mean(axis=0), 0, atol=0.04)
    np.testing.assert_allclose(turned.T @ turned / 4000, np.eye(3) / 3, atol=0.03)


@given(seeds, vectors, vectors)
def test_inverse_undoes_a_pose(seed, translation, point):
    pose = geometry.rigid(geometry.rotation_from_quaternion(quaternion(seed)), translation)
    moved = geometry.transform_points(pose, point)
    back = geometry.transform_points(geometry.inverse(pose), moved)
    np.testing.assert_allclose(back, point, atol=1e-9)
    np.testing.assert_allclose(geometry.inverse(pose), np.linalg.inv(pose), atol=1e-9)


@given(vectors, vectors)
def test_a_camera_sees_its_target_in_the_middle(eye, target):
    if np.linalg.norm(eye - target) < 1e-2:
        return
    pose = geometry.look_at(eye, target)
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-9)
    assert np.linalg.det(pose[:3, :3]) > 0
    seen = geometry.transform_points(geometry.inverse(pose), target)
    np.testing.assert_allclose(seen, [0, 0, np.linalg.norm(target - eye)], atol=1e-9)
    assert pose[2, 0] == 0 or abs(pose[2, 0]) < 1e-9, "x stays level"
    assert pose[2, 1] <= 1e-9, "y points down"


def test_a_camera_may_look_straight_down():
    pose = geometry.look_at((0, 0, 1), (0, 0, 0))
    np.testing.assert_allclose(pose[:3, 2], [0, 0, -1])
    np.testing.assert_allclose(np.linalg.det(pose[:3, :3]), 1)


def test_points_across_the_last_axis_are_an_error():
    with pytest.raises(ValueError, match=r"operand|dimension"):
        geometry.transform_points(np.eye(4), np.zeros((3, 4)))
    images = np.random.default_rng(0).normal(size=(2, 5, 3))
    one = [[geometry.transform_points(np.diag([2.0, 3, 4, 1]), p) for p in row] for row in images]
    np.testing.assert_allclose(geometry.transform_points(np.diag([2.0, 3, 4, 1]), images), one)


@given(arrays(float, (7, 3), elements=st.floats(-2, 2)), st.floats(-1, 1), st.floats(-1, 1))
def test_boxes_by_columns_are_those_of_rows(points, low, high):
    lowest, highest = geometry.bounds(points)
    np.testing.assert_array_equal([lowest, highest], [points.min(axis=0), points.max(axis=0)])
    corners = np.array([low, -1, low]), np.array([high, 1, 2])
    expected = ((points >= corners[0]) & (points <= corners[1])).all(axis=1)
    np.testing.assert_array_equal(geometry.within(points, *corners), expected)
    assert not geometry.within(np.full((2, 3), np.nan), *corners).any()
