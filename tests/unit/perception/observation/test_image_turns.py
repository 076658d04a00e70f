"""Images of rolled cameras: the same points of the world, with up above."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.types import GridSpec
from scenefw.mapping.projective import Projective
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.image_turns import quarter_turns, turned
from scenefw.perception.observation.observer import Observer
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.workspace import WorkspaceFinder


@pytest.mark.parametrize("turns", [0, 1, 2, 3, 4, -1])
def test_points_stay_and_only_pixels_move(turns):
    camera = camera_at(size=(32, 24))
    frame = replace(frame_of(camera), camera=replace(camera, cx=13.0, cy=12.5, fx=30.0))
    rotated = turned(frame, turns)
    np.testing.assert_allclose(
        world_points(rotated), np.rot90(world_points(frame), turns), atol=1e-9
    )
    np.testing.assert_array_equal(rotated.labels, np.rot90(frame.labels, turns))
    back = turned(rotated, -turns)
    np.testing.assert_array_equal(back.depth, frame.depth)
    np.testing.assert_allclose(back.camera.T_world_camera, frame.camera.T_world_camera)


@pytest.mark.parametrize("roll", [0, 30, 90, 180, -90, -120])
def test_floors_say_where_up_is(roll):
    frame = frame_of(camera_at(roll=np.radians(roll)), noise=0.0005)
    turns = quarter_turns(FloorFinder().find(frame))
    assert (turns == 0) == (abs(roll) < 45)
    right, down, _ = FloorFinder().find(turned(frame, turns)).normal
    assert -down > np.cos(np.radians(46)) * np.hypot(right, down)


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_image_is_the_same_observation(turns):
    frame = frame_of(camera_at(size=(160, 120)), noise=0.0005)
    observer = Observer(Projective(), FloorFinder(), WorkspaceFinder(OBSTACLES), Doctor())
    upright = observer.observe(frame, GridSpec(resolution=32))
    view = observer.observe(turned(frame, turns), GridSpec(resolution=32))
    assert view.turns == -turns % 4
    assert view.depth.shape == frame.depth.shape
    np.testing.assert_allclose(view.camera.T_world_camera, upright.camera.T_world_camera, atol=0.01)
    same = view.workspace.objects == upright.workspace.objects
    assert same.mean() > 0.999
