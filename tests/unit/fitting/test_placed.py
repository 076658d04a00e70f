"""Distances to fitted superquadrics, beside those of their shapes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.types import Pose
from scenefw.fitting.placed import in_frame_of, shape_of, signed_distance


def placed(half_axes, exponents, seed=0):
    quaternion = np.roll(Rotation.random(random_state=seed).as_quat(), 1)
    pose = Pose(np.array([0.1, -0.2, 0.3]), quaternion)
    return FittedSuperquadric(np.array(half_axes), np.array(exponents), pose, 0.0, np.empty(0))


axes = st.tuples(*[st.floats(0.005, 0.4)] * 3)
powers = st.tuples(*[st.floats(1.1, 100.0)] * 3)


@given(axes, powers, st.integers(0, 100))
def test_they_are_those_of_the_shape(half_axes, exponents, seed):
    fitted = placed(half_axes, exponents, seed)
    points = np.random.default_rng(seed).normal(0, 0.3, (40, 3))
    expected = shape_of(fitted).first_order_distance(in_frame_of(fitted, points))
    np.testing.assert_allclose(signed_distance(fitted, points), expected, rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("shape", [(3,), (0, 3), (4, 5, 3)])
def test_any_number_of_points(shape):
    points = np.random.default_rng(0).normal(0, 0.3, shape)
    distances = signed_distance(placed((0.1, 0.1, 0.1), (2, 2, 2)), points)
    expected = np.linalg.norm(points - (0.1, -0.2, 0.3), axis=-1) - 0.1  # a sphere
    np.testing.assert_allclose(distances, expected, atol=1e-9)
