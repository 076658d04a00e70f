"""Oddities of boxes whose place, size and share in free space are known."""

import itertools

import numpy as np
import pytest

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera
from scenefw_single_view_benchmarks.sanity import FLAGS, in_free_space, sanity

# Straight from above, a metre over the floor: a pixel is about 6 mm wide there
CAMERA = Camera(160, 120, 160.0, 160.0, 79.5, 59.5, look_at((0, 0, 1.0), (0, 1e-6, 0)))
FLOOR = np.ones((120, 160), np.float32)
NOTHING = np.zeros((0, 3))


def box(low, high, count=20):
    """Corners, and points inside."""
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    steps = [np.linspace(a, b, 2 * count + 1)[1::2] for a, b in zip(low, high, strict=True)]
    return corners, np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 3)


def depth_of(low, high, top):
    """The floor with a plateau seen from above."""
    v, u = np.indices(FLOOR.shape)
    distance = 1.0 - top
    pose = CAMERA.T_world_camera
    rays = np.stack(
        [(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], -1
    )
    places = rays * distance @ pose[:3, :3].T + pose[:3, 3]
    inside = ((places[..., :2] >= low[:2]) & (places[..., :2] <= high[:2])).all(-1)
    return np.where(inside, np.float32(distance), FLOOR)


def examined(low, high, *, visible=None, others=NOTHING, depth=None):
    corners, interior = box(low, high)
    visible = corners[corners[:, 2] == high[2]].repeat(5, axis=0) if visible is None else visible
    depth = depth_of(low, high, high[2]) if depth is None else depth
    return sanity(corners, interior, visible, others, depth, CAMERA)


def test_a_box_on_the_floor_is_not_odd():
    measures = examined((-0.05, -0.05, 0.0), (0.05, 0.05, 0.1))
    assert measures.flags == set()
    assert measures.length == pytest.approx(0.1)
    assert (measures.below, measures.gap) == (0, 0)
    assert measures.free_ratio < 0.1  # of its outline


def test_each_oddity_is_flagged_alone():
    low, high = (-0.05, -0.05, 0.0), (0.05, 0.05, 0.1)
    assert examined((-0.05, -0.05, -0.03), high).flags == {"below"}
    seen = np.tile([[0.0, 0.0, 0.1], [0.04, 0.0, 0.1]], (10, 1))
    assert examined(low, high, visible=seen).flags == {"long"}
    assert examined(low, high, visible=seen[:4]).flags == {"unseen"}
    assert examined(low, high, depth=FLOOR).flags == {"free"}
    assert examined((-0.05, -0.05, 0.02), high).flags == {"hovering"}
    assert {"below", "long", "unseen", "free", "hovering"} == set(FLAGS)


def test_what_stands_on_another_object_does_not_hover():
    under, _ = box((-0.05, -0.05, 0.0), (0.05, 0.05, 0.1))
    measures = examined((-0.05, -0.05, 0.105), (0.05, 0.05, 0.2), others=under)
    assert measures.gap == pytest.approx(0.005)
    assert measures.flags == set()


def test_short_objects_may_be_longer_than_what_is_seen():
    seen = np.tile([[0.0, 0.0, 0.07], [0.01, 0.0, 0.07]], (10, 1))
    assert examined((0.0, 0.0, 0.0), (0.07, 0.07, 0.07), visible=seen).flags == set()


def test_half_of_a_box_in_free_space():
    """Half of the pixels see a surface at its top, the others the floor."""
    low, high = np.array((-0.1, -0.1, 0.2)), np.array((0.1, 0.1, 0.3))
    _, interior = box(low, high)
    half = depth_of(low - 1, (0.0, 1.0, 0.0), 0.3)
    assert in_free_space(interior, half, CAMERA).mean() == pytest.approx(0.5, abs=0.06)


def test_nothing_is_known_where_nothing_is_measured_or_seen():
    points = np.array([[0.0, 0.0, 0.5], [5.0, 0.0, 0.5], [0.0, 0.0, 2.0]])
    assert in_free_space(points, FLOOR, CAMERA).tolist() == [True, False, False]
    assert not in_free_space(points, np.zeros_like(FLOOR), CAMERA).any()
