"""Resting poses against planes and angles worked out by hand."""

import numpy as np
import pytest

from scenefw_tabletops.scenes.drape import draped
from scenefw_tabletops.scenes.resting import Relief, body_of, resting_pose
from scenefw_tabletops.shapes.tabletop import parts
from scenefw_tabletops.shapes.tabletop.parts import Look

LOOK = Look((0.5, 0.5, 0.5))


def body(size):
    mesh = parts.merge([parts.box(size, (0, 0, size[2] / 2), LOOK)])
    return body_of(mesh.vertices, mesh.faces)


def put(relief, size, place):
    found = resting_pose(body(size), relief, np.array(place), np.eye(3), 1.0, 1.0)
    relief.raise_to(found.moved(body(size).high))
    return found


def test_a_body_is_what_the_mesh_is():
    found = body((0.1, 0.06, 0.03))
    assert np.allclose(np.sort(found.low[:, 2])[:-4], 0, atol=1e-6)  # but for upper corners
    assert np.allclose(np.sort(found.high[:, 2])[4:], 0.03, atol=1e-6)
    assert np.allclose(found.centre, [0, 0, 0.015], atol=1e-3)
    assert np.allclose(np.abs(found.low[:, :2]).max(axis=0), [0.05, 0.03], atol=0.002)


def test_a_box_lies_flat_on_the_table_and_on_another():
    relief = Relief(0.5)
    first = put(relief, (0.2, 0.2, 0.03), (0, 0))
    second = put(relief, (0.1, 0.05, 0.02), (0.03, 0.02))
    assert first.origin == pytest.approx([0, 0, 0], abs=1e-6)
    assert second.origin == pytest.approx([0.03, 0.02, 0.03], abs=1e-6)
    assert np.allclose(second.rotation, np.eye(3))
    assert relief.heights.max() == pytest.approx(0.05, abs=1e-6)


def test_a_plank_leans_on_an_edge():
    """Its far end on the table, it passes the edge of a box: sine of the angle by both."""
    relief = Relief(0.8)
    put(relief, (0.1, 0.2, 0.03), (0.2, 0))  # its edge is at x = 0.15
    found = put(relief, (0.3, 0.03, 0.004), (0.05, 0))
    low_end = found.moved(np.array([[-0.15, 0, 0.0]]))[0]
    assert low_end[2] == pytest.approx(0, abs=0.0015)
    expected = np.arctan2(0.03, 0.15 - low_end[0])
    assert found.tilt == pytest.approx(expected, abs=0.01)
    assert found.rotation @ [0, 1, 0] == pytest.approx([0, 1, 0], abs=0.01)


def test_a_plank_falls_towards_its_centre_of_mass():
    """On an edge left of its middle, its right end is down, and the other way round."""
    for edge, down in ((-0.06, 1), (0.06, -1)):
        relief = Relief(0.8)
        put(relief, (0.02, 0.2, 0.03), (edge, 0))
        found = put(relief, (0.3, 0.03, 0.004), (0, 0))
        ends = found.moved(np.array([[-0.15, 0, 0.0], [0.15, 0, 0.0]]))[:, 2]
        assert ends[(1 + down) // 2] == pytest.approx(0, abs=0.0015)
        assert ends.max() > 0.02


def test_nothing_sinks_in():
    rng = np.random.default_rng(0)
    relief = Relief(0.4)
    for _ in range(12):
        size = rng.uniform([0.03, 0.02, 0.004], [0.12, 0.08, 0.03])
        yaw = rng.uniform(0, 6)
        c, s = np.cos(yaw), np.sin(yaw)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        found = resting_pose(body(size), relief, rng.uniform(-0.1, 0.1, 2), turn, 1.0, 1.2)
        if found is not None:
            under = found.moved(body(size).low)
            gap = under[:, 2] - relief.at(under)
            assert gap.min() == pytest.approx(0, abs=1e-9)
            relief.raise_to(found.moved(body(size).high))


def test_what_is_too_steep_or_outside_finds_no_rest():
    relief = Relief(0.5)
    put(relief, (0.1, 0.2, 0.06), (0.1, 0))
    plank = body((0.12, 0.03, 0.004))
    assert resting_pose(plank, relief, np.array([0.03, 0]), np.eye(3), 1.0, 0.1) is None
    assert resting_pose(plank, relief, np.array([0.23, 0]), np.eye(3), 1.0, 1.0) is None


def test_a_cable_lies_over_a_box_and_on_the_table():
    relief = Relief(0.8)
    put(relief, (0.1, 0.1, 0.02), (0, 0))
    x = np.arange(-0.2, 0.2001, 0.005)
    spine = np.column_stack([x, np.zeros_like(x), np.full_like(x, 0.002)])
    found = draped(spine, relief)
    over = np.abs(x) < 0.045
    assert np.allclose(found.lifts[over], 0.02, atol=1e-6)
    assert np.allclose(found.lifts[np.abs(x) > 0.1], 0, atol=1e-6)
    assert np.abs(np.diff(found.lifts)).max() <= 0.9 * 0.005 + 1e-9
    assert (found.lifts >= relief.at(spine) - 1e-9).all()
    assert found.top[:, 2].max() == pytest.approx(0.024, abs=1e-6)
