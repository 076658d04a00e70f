"""Unions of convex parts, beside boxes whose union is known."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scenefw_things.shapes.part_unions import ball_about, inside, planes_of, surface_points
from scenefw_things.shapes.solids import box


def two():
    """Two boxes that share a side: together 0.2 x 0.1 x 0.1 m."""
    return [box((0.1, 0.1, 0.1), (x, 0, 0)) for x in (-0.05, 0.05)]


def test_a_box_has_six_sides_and_lies_in_its_ball():
    corners = two()[0]
    planes, ball = planes_of(corners), ball_about(corners)
    assert planes.shape == (6, 4)
    np.testing.assert_allclose(np.linalg.norm(corners - ball[:3], axis=1), ball[3])


@given(st.integers(0, 10**6))
def test_inside_is_what_the_boxes_hold(seed):
    points = np.random.default_rng(seed).uniform(-0.15, 0.15, (200, 3))
    expected = (np.abs(points) <= (0.1, 0.05, 0.05)).all(axis=1)
    np.testing.assert_array_equal(inside(points, [planes_of(part) for part in two()]), expected)
    assert not inside(points, []).any()


def test_points_cover_the_surface_evenly_and_not_the_common_side():
    parts = two()
    points = surface_points(parts, [planes_of(p) for p in parts], 4000, np.random.default_rng(0))
    assert points.shape == (4000, 3)
    outer = np.abs(np.abs(points) - (0.1, 0.05, 0.05)) < 1e-9
    assert outer.any(axis=1).all()
    shares = outer.mean(axis=0)  # of sides of 0.02, 0.04 and 0.04 m^2
    np.testing.assert_allclose(shares, [0.2, 0.4, 0.4], atol=0.03)
    assert not surface_points([], [], 5, np.random.default_rng(0)).any()
