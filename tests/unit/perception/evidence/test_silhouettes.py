"""Places that a view looks past, beside boxes whose surfaces are known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.perception.evidence.test_gathering import distance
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.perception.evidence.silhouettes import passed_places
from scenefw.perception.observation.points import world_points

EYE = (0.0, -0.85, 0.6)


def seen(boxes=STACK, size=320, eye=EYE):
    camera = camera_at(eye=eye)
    camera = camera.resized(size, size * camera.height // camera.width)
    frame = replace(frame_of(camera, boxes), camera=camera)
    return world_points(frame), frame.labels, camera.T_world_camera[:3, 3]


@pytest.mark.parametrize("size", [160, 320])
@pytest.mark.parametrize("label", [1, 2])
def test_places_are_free_and_close_to_the_object(size, label):
    points, labels, eye = seen(size=size)
    found = passed_places(labels == label, points, eye, 200)
    assert 100 < len(found) <= 200
    assert found[:, 2].min() > 0  # above the floor
    for box in STACK:
        assert distance(found, box).min() > 0
    assert np.median(distance(found, STACK[label - 1])) < 0.08


@given(st.floats(0.0, 6.28), st.floats(0.3, 1.2))
def test_no_place_lies_in_a_box_wherever_the_camera_stands(turn, height):
    eye = (0.9 * np.cos(turn), 0.9 * np.sin(turn), height)
    points, labels, eye = seen(eye=eye, size=160)
    for label in (1, 2):
        found = passed_places(labels == label, points, eye, 100)
        assert all((distance(found, box) > -1e-6).all() for box in STACK)


def test_they_say_that_an_object_does_not_go_on_beside_what_is_seen():
    """A box twice as wide contains many of them, the box itself none."""
    box = Box((-0.05, -0.05, 0.0), (0.05, 0.05, 0.1))
    wider = Box((-0.05, -0.05, 0.0), (0.15, 0.05, 0.1))
    points, labels, eye = seen((box,))
    found = passed_places(labels == 1, points, eye, 300)
    assert (distance(found, box) > 0).all()
    assert (distance(found, wider) < -0.005).mean() > 0.1


def test_what_hides_an_object_or_was_not_measured_says_nothing():
    before = Box((-0.3, -0.2, 0.0), (0.3, -0.15, 0.4))
    hidden = Box((-0.05, 0.05, 0.0), (0.05, 0.15, 0.5))
    points, labels, eye = seen((before, hidden))
    found = passed_places(labels == 2, points, eye, 300)
    assert len(found)
    assert (found[:, 1] > -0.15).all()  # none where the first box hides what is behind
    assert distance(found, before).min() > 0
    nothing = np.where((labels == 2)[..., None], points, np.nan)
    assert passed_places(labels == 2, nothing, eye, 300).shape == (0, 3)
    assert passed_places(labels == 9, points, eye, 300).shape == (0, 3)
    assert passed_places(labels == 2, points, eye, 0).shape == (0, 3)
