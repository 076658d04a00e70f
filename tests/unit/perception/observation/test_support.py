"""What stands on a floor and what stands beside it: boxes whose places are known."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.support import standing_pixels

MIN_HEIGHT = 0.015
TABLE = Box((-0.4, -0.4, -0.03), (0.4, 0.4, 0.0))


def standing(boxes, table=TABLE, eye=(0.0, -1.0, 0.8), size=(320, 240), room=-0.7):
    """Share of each box's pixels above the floor that stand."""
    camera = camera_at(eye=eye, size=size)
    frame = frame_of(camera, boxes, table=table, room=room)
    points = world_points(replace(frame, camera=camera))
    raised = points[..., 2] > MIN_HEIGHT
    mask = standing_pixels(frame.depth, points, raised, MIN_HEIGHT, 60 * (size[0] / 640) ** 2)
    return [mask[raised & (frame.labels == i)].mean() for i in range(1, len(boxes) + 1)]


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_boxes_over_the_rim_stand_and_furniture_behind_does_not(size):
    over_rim = Box((0.33, -0.1, 0.0), (0.45, 0.1, 0.1))
    behind = Box((-0.2, 0.8, -0.7), (0.2, 1.0, 0.2))
    shares = standing((over_rim, behind), size=size)
    assert shares[0] > 0.95
    assert shares[1] < 0.05


def test_a_box_behind_others_stands_though_no_floor_is_seen_beside_it():
    """The front boxes hide the floor up to a box at the table's far edge."""
    front = Box((-0.4, 0.1, 0.0), (0.4, 0.25, 0.12))
    back = Box((-0.3, 0.28, 0.0), (0.3, 0.39, 0.2))
    assert min(standing((front, back))) > 0.95


def test_what_lies_on_another_one_stands():
    below, above = (
        Box((-0.1, -0.1, 0.0), (0.1, 0.1, 0.1)),
        Box((-0.05, -0.05, 0.1), (0.05, 0.05, 0.2)),
    )
    assert min(standing((below, above))) > 0.95


def test_without_a_floor_nothing_stands():
    frame = frame_of(camera_at(), ())
    points = world_points(replace(frame, camera=camera_at())) + (0, 0, 0.1)
    raised = np.ones(frame.depth.shape, dtype=bool)
    assert not standing_pixels(frame.depth, points, raised, MIN_HEIGHT, 60).any()


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
@pytest.mark.parametrize("gap", [0.0, 0.05])
def test_what_stands_on_a_lower_table_beside_does_not_stand_on_this_one(size, gap):
    on_table = Box((0.2, -0.1, 0.0), (0.35, 0.1, 0.1))
    beside = Box((0.4 + gap, -0.2, -0.12), (0.55 + gap, 0.1, 0.06))
    shares = standing((on_table, beside), size=size, room=-0.12, eye=(0.9, -0.8, 0.6))
    assert shares[0] > 0.95
    assert shares[1] < 0.05
