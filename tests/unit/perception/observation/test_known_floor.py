"""A known floor: that of the camera, of an earlier prediction; mistakes; a moved camera."""

import json

import numpy as np
import pytest
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw import config, plugins
from scenefw.core.errors import ConfigError, InputError, SettingError
from scenefw.data.files.readers import read_frames
from scenefw.execution.build import Builder
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.known_floor import KnownFloor
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.table_frame import TableFrame


def plane_of(camera):
    """Normal and height of the floor z = 0 in a camera's coordinates."""
    pose = camera.T_world_camera
    return pose[2, :3], pose[2, 3]


@pytest.mark.parametrize("size", [(160, 120), (320, 240)])
def test_it_is_the_cameras_where_hardly_any_table_is_seen(size):
    camera = camera_at(eye=(0.0, -0.5, 0.5), size=size)
    lid = Box((-0.4, -0.12, 0.0), (0.4, 0.5, 0.2))  # a box that looks like a table
    frame = frame_of(camera, boxes=(lid,), noise=0.001)
    normal, height = plane_of(camera)
    assert FloorFinder().find(frame).height < height - 0.1  # its top is taken for one
    floor = KnownFloor(normal.tolist(), height).find(frame)
    np.testing.assert_allclose(floor.normal, normal, atol=1e-12)
    assert floor.height == height
    assert floor.share == pytest.approx((frame.labels == 0).mean(), abs=0.05)
    assert floor.deviation == pytest.approx(0.001, rel=1.0)


def test_that_of_an_earlier_prediction(tmp_path):
    frame = frame_of(camera_at(), noise=0.002)
    found = FloorFinder().find(frame)
    scene = tmp_path / "scene.json"
    plane = {"normal": found.normal.tolist(), "height": found.height}
    scene.write_text(json.dumps({"floor": plane}), "utf-8")
    floor = KnownFloor(scene=str(scene)).find(frame)
    np.testing.assert_allclose(floor.T_world_camera, found.T_world_camera, atol=1e-12)
    assert (floor.share, floor.deviation) == pytest.approx((found.share, found.deviation))


def test_from_the_command_line_and_for_sequences():
    plugins.activate()  # which bring run=doctor
    camera = camera_at()
    normal, height = plane_of(camera)
    words = ["run=doctor", "input=x", "device=cpu", "floor=known"]
    words += [f"floor.normal={normal.tolist()}", f"floor.height={height}"]
    floor = Builder(config.compose(words)).build("run.examiner.floor")
    assert isinstance(floor, KnownFloor)
    frame = frame_of(camera, noise=0.001)
    rectified = TableFrame(floor).rectified(frame)
    assert rectified.camera.T_world_camera[2, 3] == pytest.approx(height)
    heights = world_points(rectified)[..., 2]
    assert abs(np.median(heights[frame.labels == 0])) < 0.001


def test_a_camera_that_has_moved():
    normal, height = plane_of(camera_at())
    known = KnownFloor(normal, height)
    with pytest.raises(InputError, match=r"synthetic: 0% of the points lie .* camera moved\?"):
        known.find(frame_of(camera_at(eye=(0.1, -0.8, 0.7), target=(0.0, 0.0, 0.15)), boxes=()))


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, "give floor.normal and floor.height, or floor.scene"),
        ({"normal": [0, 0, -1]}, "give floor.normal and floor.height"),
        ({"normal": [0, 0, -1], "height": 1, "scene": "x"}, "give floor.normal"),
        ({"normal": [0, 0, -1], "scene": "x"}, "give floor.normal"),
        ({"height": 1, "scene": "x"}, "give floor.normal"),
        ({"normal": [0, 0, -2], "height": 1}, "3 numbers of a unit vector"),
        ({"normal": [0, -1], "height": 1}, "3 numbers of a unit vector"),
        ({"normal": ["a", 0, 1], "height": 1}, "3 numbers of a unit vector"),
    ],
)
def test_mistakes(settings, expected):
    with pytest.raises(ConfigError, match=expected):
        KnownFloor(**settings)


@pytest.mark.parametrize("height", [0.0, -0.5, float("nan")])
def test_a_height_below_the_floor(height):
    with pytest.raises(SettingError, match="height"):
        KnownFloor([0, 0, -1], height)


CONTENTS = [
    None,
    "{",
    "[]",
    '{"floor": null}',
    '{"floor": {}}',
    '{"floor": {"normal": [0, 0, -2], "height": 1}}',
    '{"floor": {"normal": [0, 0, -1], "height": -1}}',
]


@pytest.mark.parametrize("content", CONTENTS)
def test_a_scene_without_floor(tmp_path, content):
    path = tmp_path / "scene.json"
    if content is not None:
        path.write_text(content, "utf-8")
    with pytest.raises(InputError, match=r"no floor in .*scene\.json; give the scene.json"):
        KnownFloor(scene=str(path))


def test_real_images(real_data):
    """The floor of an image is its own, and one 30 cm lower isn't."""
    frames = read_frames(real_data / "real" / "mosd_learn")
    found = FloorFinder().find(frames[0])
    assert KnownFloor(found.normal, found.height).find(frames[0]).share > 0.5
    with pytest.raises(InputError, match="camera moved"):
        KnownFloor(found.normal, found.height + 0.3).find(frames[0])
