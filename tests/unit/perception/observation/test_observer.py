"""An image comes into the frame of its floor, and is checked: boxes whose places are known."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.perception.observations import observation_of
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.mapping.projective import Projective
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.observer import Observer
from scenefw.perception.observation.workspace import WorkspaceFinder

GRID = GridSpec(resolution=32)
OBSERVER = Observer(Projective(), FloorFinder(), WorkspaceFinder(OBSTACLES), Doctor())


@pytest.mark.parametrize("size", [(160, 120), (320, 240)])
def test_the_floor_is_level_and_the_objects_are_in_the_middle(size):
    frame = frame_of(camera_at(eye=(0.1, -0.8, 0.6), size=size), noise=0.0005)
    view = OBSERVER.observe(frame, GRID)
    assert view.source is frame
    assert view.masks is None
    assert view.warnings == ()
    assert view.floor.height == pytest.approx(0.6, abs=0.005)
    assert np.median(view.heights[frame.labels == 0]) == pytest.approx(0, abs=0.002)
    assert np.quantile(view.heights[frame.labels == 2], 0.9) == pytest.approx(0.2, abs=0.005)
    lower, upper = (np.nanquantile(view.points[frame.labels > 0], q, axis=0) for q in (0, 1))
    assert np.abs(lower + upper)[:2].max() < 0.06
    high = view.heights > 0.02  # lower pixels may belong to the floor
    np.testing.assert_array_equal(view.workspace.objects[high], frame.labels[high] > 0)
    assert (high & (frame.labels > 0)).sum() > 0.9 * (frame.labels > 0).sum()
    assert not view.workspace.objects[frame.labels == 0].any()


def test_volumes_and_pixels_have_the_same_camera():
    view = OBSERVER.observe(frame_of(camera_at()), GRID)
    again = observation_of(view.frame, GRID)
    assert torch.equal(view.partial.distance, again.partial.distance)
    assert torch.equal(view.partial.cameras.T_world_camera, again.partial.cameras.T_world_camera)
    pose = view.partial.cameras.T_world_camera[0].double().numpy()
    np.testing.assert_array_equal(view.camera.T_world_camera, pose)


def test_whole_numbers_are_ids_of_objects_in_the_cube():
    beside = Box((2.0, 0.0, 0.0), (2.2, 0.2, 0.2))
    frame = frame_of(camera_at(eye=(0.4, -1.5, 1.4), target=(0.8, 0.0, 0.0)), (*STACK, beside))
    marks = 5 * frame.labels.astype(np.int64)
    view = OBSERVER.observe(frame, GRID, marks)
    assert (marks == 15).any()
    high = (view.heights > 0.02) & (marks < 15)  # lower pixels may belong to the floor
    np.testing.assert_array_equal(np.array([0, *view.ids])[view.masks[high]], marks[high])
    assert view.ids == (5, 10)
    assert not view.masks[marks == 15].any()
    assert not view.masks[marks == 0].any()
    assert view.masks.dtype == np.int32
    assert OBSERVER.observe(frame, GRID, marks > 0).masks is None


def test_what_looks_wrong_is_told_of_the_image_and_of_the_objects():
    frame = frame_of(camera_at(eye=(0.2, -2.2, 1.6)))
    (far,) = OBSERVER.observe(frame, GRID).warnings
    assert [far] == Doctor().examine_workspace(*placed(frame))
    odd = replace(frame, camera=replace(frame.camera, fx=1.2 * frame.camera.fx))
    (of_image,) = Doctor().examine_frame(odd)
    assert OBSERVER.observe(odd, GRID).warnings[0] == of_image
    assert len(OBSERVER.observe(odd, GRID).warnings) > 1


def placed(frame):
    """The floor and the workspace of a frame."""
    floor = FloorFinder().find(frame)
    return floor, WorkspaceFinder(OBSTACLES).find(frame, floor, GRID)


def test_an_unusable_image_is_refused():
    frame = frame_of(camera_at())
    with pytest.raises(InputError, match="millimetres given as metres"):
        OBSERVER.observe(replace(frame, depth=1000 * frame.depth), GRID)


def test_what_is_odd_about_an_image_explains_why_it_is_refused():
    frame = frame_of(camera_at())
    odd = replace(frame, camera=replace(frame.camera, fy=0.9 * frame.camera.fy))
    grid = GridSpec(resolution=32, extent=0.12, lower=(-0.06, -0.06, -0.02))
    with pytest.raises(InputError, match=r"the cube holds [^()]*$"):
        OBSERVER.observe(frame, grid)
    with pytest.raises(InputError, match=r"the cube holds .* \(fx = .* differ; check the intrins"):
        OBSERVER.observe(odd, grid)
