"""Solids pushed out of each other and out of the floor."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scenefw.core.types import PlacedShape, Pose
from scenefw.shapes.superquadric import Superquadric
from scenefw_scene_prior.pushing_apart import pushed_apart

STILL = np.array([1.0, 0.0, 0.0, 0.0])


def block(place, half_axes=(0.05, 0.05, 0.05), exponents=(30.0, 30.0, 30.0), quaternion=STILL):
    shape = Superquadric(np.array(half_axes), np.array(exponents))
    return PlacedShape(shape, Pose(np.array(place, dtype=float), quaternion))


def ball(place, radius=0.05):
    return block(place, (radius,) * 3, (2.0, 2.0, 2.0))


def test_what_touches_nothing_stays():
    before = [block((0, 0, 0.05)), block((0.2, 0, 0.06)), ball((0, 0.3, 0.05))]
    for one, other in zip(before, pushed_apart(before), strict=True):
        assert np.allclose(one.pose.position, other.pose.position, atol=1e-9)
    assert pushed_apart([]) == []


def test_balls_end_side_by_side():
    """Each goes half of the way, along the line of their centres."""
    after = pushed_apart([ball((0, 0, 0.05)), ball((0.06, 0, 0.05))], deepest=1e-5)
    places = np.array([one.pose.position for one in after])
    assert np.linalg.norm(places[1] - places[0]) == pytest.approx(0.1, abs=2e-3)
    assert places.mean(axis=0) == pytest.approx([0.03, 0, 0.05], abs=1e-3)


def test_what_is_in_the_floor_rises_and_lifts_what_is_on_it():
    after = pushed_apart([block((0, 0, 0.02)), block((0, 0, 0.13))], deepest=1e-4, rounds=500)
    low, high = (one.pose.position[2] for one in after)
    assert low == pytest.approx(0.05, abs=1e-3)
    assert high == pytest.approx(0.15, abs=2e-3)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_afterwards_no_point_of_one_is_deep_in_another(seed):
    random = np.random.default_rng(seed)
    before = [
        block(
            (*random.uniform(-0.06, 0.06, 2), random.uniform(0, 0.1)),
            random.uniform(0.02, 0.08, 3),
            random.uniform(2, 20, 3),
            np.roll(Rotation.random(random_state=seed + k).as_quat(), 1),
        )
        for k in range(3)
    ]
    after = pushed_apart(before, deepest=5e-4, rounds=400)
    for a, b in combinations(after, 2):
        for one, other in ((a, b), (b, a)):
            points = (one.mesh().vertices - other.pose.position) @ other.pose.rotation
            assert other.shape.first_order_distance(points).min() > -4e-3
    assert min(one.mesh().vertices[:, 2].min() for one in after) > -2e-3
    for one, other in zip(before, after, strict=True):
        assert np.array_equal(one.pose.quaternion, other.pose.quaternion)
        assert one.shape is other.shape
