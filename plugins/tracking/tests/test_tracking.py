import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from plugins.tracking.tests.moving_boxes import CROWD, box, camera, image, pipeline

from scenefw import plugins
from scenefw.api.predictor import Predictor
from scenefw.contracts import problems
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.protocols import ObjectTracking, SceneOverTime
from scenefw_tracking.tracked_scene import TrackedScene
from scenefw_tracking.tracker import Tracker

BASE = np.array([[0, -1, 0, 0.5], [1, 0, 0, 0.1], [0, 0, 1, 0.2], [0, 0, 0, 1.0]])
"""The table in the coordinates of a robot's base."""


@pytest.fixture(scope="module")
def predictions():
    """A box moves by 6 cm along x, in the images of a camera whose pose in a base is known."""
    tracking = Predictor(pipeline(samples=1)).track()
    shifted = (box(-0.2, -0.06), *CROWD[1:])
    pose = BASE @ camera().T_world_camera
    return [
        tracking.predict(image(boxes, i).depth, camera(), camera_pose=pose)
        for i, boxes in enumerate([CROWD, CROWD, shifted])
    ]


def test_objects_have_the_same_ids_in_all_images(predictions):
    first, second, third = predictions
    ids = [[item.id for item in prediction.objects] for prediction in predictions]
    assert ids == [[1, 2, 3]] * 3
    assert {(t["state"], t["since"]) for t in first.tracks} == {("new", "image_1")}
    assert {(t["state"], t["since"]) for t in second.tracks} == {("still", "image_1")}
    (moved,) = [t for t in third.tracks if t["state"] == "moved"]
    assert moved["since"] == "image_3"
    assert second.objects[0].mesh is first.objects[0].mesh


def test_a_single_image_has_no_tracks(predictions):
    alone = Predictor(pipeline(samples=1)).predict(image(CROWD, 0).depth, camera())
    assert alone.tracks == ()
    for item, again in zip(alone.objects, predictions[0].objects, strict=True):
        np.testing.assert_array_equal(item.mesh.vertices, again.mesh.vertices)


def test_motions_are_written_in_the_coordinates_of_the_objects(predictions, tmp_path):
    """From the base, the box moves by 6 cm along x: the table's -y."""
    records = [
        json.loads(prediction.save(tmp_path / f"{i}.json").read_text())
        for i, prediction in enumerate(predictions)
    ]
    (moved,) = [track for track in records[2]["tracks"] if track["state"] == "moved"]
    before, after = (
        next(item["centre"] for item in record["objects"] if item["id"] == moved["id"])
        for record in records[1:]
    )
    motion = np.array(moved["motion"])
    np.testing.assert_allclose(motion[:3, :3] @ before + motion[:3, 3], after, atol=0.015)
    np.testing.assert_allclose(np.subtract(after, before), (0.06, 0, 0), atol=0.015)


def test_what_is_wrong_is_said(predictions):
    tracking = Predictor(pipeline(samples=1)).track()
    tracking.predict(image(CROWD, 0).depth, camera(), name="first")
    with pytest.raises(InputError, match="no intrinsics of image_2"):
        tracking.predict(image(CROWD, 1).depth)
    with pytest.raises(
        InputError, match="second is 160 x 120, but the images before are 320 x 240"
    ):
        tracking.predict(image(CROWD, 1, camera(160)).depth, camera(160), name="second")
    with pytest.raises(InputError, match="give masks of two values"):
        tracking.predict(image(CROWD, 1).depth, camera(), mask=np.full((240, 320), 3))
    pose = camera().T_world_camera.copy()
    pose[2, 3] += 0.1
    elsewhere = replace(camera(), T_world_camera=pose)
    with pytest.warns(UserWarning, match="image_2: most has changed and everything"):
        tracking.predict(image(CROWD, 1, elsewhere).depth, camera())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tracking.predict(image(CROWD, 2, elsewhere).depth, camera())


def test_without_the_plugin_one_line_says_so(monkeypatch):
    monkeypatch.setattr(plugins, "activate", lambda: ())
    with pytest.raises(ConfigError, match=r"track\(\) needs the plugin tracking"):
        Predictor(pipeline(samples=1)).track()


KEPT = [(Tracker, ObjectTracking), (TrackedScene, SceneOverTime)]


@pytest.mark.parametrize(("kept", "protocol"), KEPT)
def test_what_the_core_asks_of_a_tracker_is_there(kept, protocol):
    assert list(problems(kept, protocol)) == []
