"""Flat boxes on a table, beside taller ones."""

from dataclasses import replace

import pytest
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.types import GridSpec
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.flat_things import flat_things
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.floor_noise import FloorNoise
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.workspace import WorkspaceFinder

PHONE = Box((0.18, -0.1, 0.0), (0.26, 0.05, 0.009))
CARDS = Box((0.18, -0.1, 0.0), (0.26, 0.05, 0.006))


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_a_flat_box_is_seen_and_no_other(size, noise):
    camera = camera_at(size=size)
    frame = frame_of(camera, (*STACK, PHONE), noise=noise)
    (pixels,) = flat_things_of(frame, camera)
    phone = frame.labels == 3
    assert phone[pixels].mean() > 0.95
    assert pixels[phone].mean() > 0.5
    empty = frame_of(camera, STACK, noise=noise)
    assert flat_things_of(empty, camera) == []


def flat_things_of(frame, camera):
    heights = world_points(replace(frame, camera=camera))[..., 2]
    noise = FloorNoise.of(heights, frame.depth)
    return flat_things(heights, noise.at(frame.depth), 0.005)


def test_the_doctor_tells_flat_things():
    frame = frame_of(camera_at(), (*STACK, CARDS), noise=0.004)
    floor = FloorFinder().find(frame)
    workspace = WorkspaceFinder(OBSTACLES).find(frame, floor, GridSpec())
    (warning,) = Doctor().examine_workspace(floor, workspace)
    assert "1 thing(s) too flat for an object" in warning
    assert "right of the image" in warning
    assert workspace.objects[frame.labels == 3].mean() < 0.1


def test_a_phone_is_an_object_where_noise_does_not_reach_it():
    for noise, is_object in ((0.0, True), (0.0005, True), (0.004, False)):
        frame = frame_of(camera_at(), (*STACK, PHONE), noise=noise)
        floor = FloorFinder().find(frame)
        workspace = WorkspaceFinder(OBSTACLES).find(frame, floor, GridSpec())
        pixels = workspace.objects[frame.labels == 3]
        assert (pixels.mean() > 0.9) == is_object, noise
