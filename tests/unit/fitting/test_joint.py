"""Superquadrics of one scene: neighbours keep each other out of what nobody sees."""

import numpy as np
import pytest

from scenefw.core.errors import ConfigError
from scenefw.core.evidence import Evidence
from scenefw.fitting.joint import JointFit
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.shapes.superquadric import Superquadric

ALONE = SuperquadricFit()
HALF = np.array([0.05, 0.04, 0.06])


def shown(centre, side, count=300):
    """Points of one half of a rounded box, the one on a side of the x axis."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(count, 3)) * HALF
    directions[:, 0] = side * np.abs(directions[:, 0])
    points = Superquadric(HALF, np.full(3, 8.0)).project(directions)
    front = points[side * points[:, 0] > 0.85 * HALF[0]]  # how far it goes back is open
    return Evidence(front + centre, np.full(len(front), 0.002))


def overlap(one, other):
    """Volume (m^3) that lies in both."""
    rng = np.random.default_rng(1)
    places = rng.uniform(-0.3, 0.3, (200_000, 3))
    inside = [
        Superquadric(f.half_axes, f.exponents).value((places - f.pose.position) @ f.pose.rotation)
        < 1
        for f in (one, other)
    ]
    return (inside[0] & inside[1]).mean() * 0.6**3


def test_objects_back_to_back_share_no_place():
    """Each is seen from its own side only, so alone both grow into the middle."""
    thin = [shown((-0.02, 0, 0), -1), shown((0.02, 0, 0), 1)]
    apart = JointFit(ALONE, rounds=3).fit(thin)
    joint = JointFit(ALONE, rounds=3).separate(thin, apart)
    assert overlap(*apart) > 5e-5
    assert overlap(*joint) < 0.2 * overlap(*apart)
    for found, given in zip(joint, thin, strict=True):
        assert np.abs(found.distances).max() < 0.006
        assert len(found.distances) == len(given.points)


def test_draws_of_two_objects_keep_out_of_each_other():
    thin = [shown((-0.02, 0, 0), -1), shown((0.02, 0, 0), 1)]
    best = ALONE.fit(thin)
    draws = JointFit(ALONE, rounds=3).draws(thin, best, 5, np.random.default_rng(0))
    alone = ALONE.draws(thin, best, 5, np.random.default_rng(0))
    assert len(draws) == len(alone) == 5
    joint, apart = (sum(overlap(*draw) for draw in each) for each in (draws, alone))
    assert joint < 0.5 * apart


def test_objects_apart_stay_as_they_are():
    away = [shown((-0.15, 0, 0), -1), shown((0.15, 0, 0), 1)]
    fits = ALONE.fit(away)
    for joint, alone in zip(JointFit(ALONE).separate(away, fits), fits, strict=True):
        np.testing.assert_array_equal(joint.half_axes, alone.half_axes)
    assert JointFit(ALONE).separate([], []) == []


def test_the_fit_of_each_knows_nothing_of_the_others():
    thin = [shown((-0.02, 0, 0), -1), shown((0.02, 0, 0), 1)]
    for each, joint in zip(thin, JointFit(ALONE).fit(thin), strict=True):
        (single,) = ALONE.fit([each])
        np.testing.assert_array_equal(joint.half_axes, single.half_axes)
        np.testing.assert_array_equal(joint.pose.position, single.pose.position)
    assert JointFit(ALONE).fit([]) == []


def test_wrong_numbers_are_refused():
    with pytest.raises(ConfigError, match="rounds = 0"):
        JointFit(ALONE, rounds=0)
