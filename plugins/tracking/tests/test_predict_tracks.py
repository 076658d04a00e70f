import json

import numpy as np
import pytest
from plugins.tracking.tests.moving_boxes import CROWD, box, camera, image, pipeline

from scenefw.api.load import load
from scenefw.core.errors import IncompleteError
from scenefw.tasks.predict import Predict
from scenefw_tracking.tracker import Tracker


def save(folder, number, boxes, seen_by=None):
    """view_<number>.npz, as a camera stores it."""
    seen_by = seen_by or camera()
    depth = np.rint(image(boxes, number, seen_by).depth * 1000)
    folder.mkdir(exist_ok=True)
    np.savez(folder / f"view_{number}.npz", depth_mm=depth, K=seen_by.matrix)


def records(output):
    return {path.parent.name: json.loads(path.read_text()) for path in output.glob("*/scene.json")}


def predict(folder, output, samples=1):
    hidden = {"overview": False, "page": False}
    tracked = {"track": True, "tracking": lambda: Tracker}
    return Predict(folder, pipeline(samples), output, **tracked, **hidden).run()


def test_images_of_a_folder_name_the_same_object_alike(tmp_path):
    """In the order of their numbers, 9 before 10; each result says what its objects did."""
    taken, shifted = CROWD[1:], (box(0.02, -0.06, (0.1, 0.1, 0.05)), CROWD[2])
    for number, boxes in ((9, CROWD), (10, taken), (11, shifted)):
        save(tmp_path / "in", number, boxes)
    figures = predict(tmp_path / "in", tmp_path / "out", samples=2)
    assert figures["images"] == 3
    views = records(tmp_path / "out")
    tracks = {
        name: {t["id"]: (t["state"], t["since"]) for t in view["tracks"]}
        for name, view in views.items()
    }
    assert set(tracks["view_9"].values()) == {("new", "view_9")}
    (gone,) = [k for k, v in tracks["view_10"].items() if v == ("gone", "view_10")]
    assert tracks["view_11"][gone] == ("gone", "view_10")
    (moved,) = [k for k, v in tracks["view_11"].items() if v == ("moved", "view_11")]
    (still,) = {1, 2, 3} - {gone, moved}
    assert tracks["view_11"][still] == ("still", "view_9")
    assert [item["id"] for item in views["view_11"]["objects"]] == sorted([moved, still])
    names = {path.name for path in (tmp_path / "out" / "view_11").iterdir()}
    assert {f"object_{label:02d}.ply" for label in (moved, still)} <= names
    assert (tmp_path / "out" / "view_11" / "hypothesis_2" / "scene.json").is_file()


def test_an_image_of_another_size_is_skipped_and_the_others_are_tracked(tmp_path, capsys):
    save(tmp_path / "in", 1, CROWD)
    save(tmp_path / "in", 2, CROWD, camera(160))
    save(tmp_path / "in", 3, CROWD)
    with pytest.raises(IncompleteError, match="1 of 3 images is unusable"):
        predict(tmp_path / "in", tmp_path / "out")
    assert "160 x 120, but the images before are 320 x 240; track" in capsys.readouterr().err
    views = records(tmp_path / "out")
    assert views.keys() == {"view_1", "view_3"}
    assert {t["state"] for t in views["view_3"]["tracks"]} == {"still"}


def test_poses_of_a_recording_say_how_its_camera_moves(tmp_path):
    c, s = np.cos(0.2), np.sin(0.2)
    turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    cameras = [camera(), camera().moved(turn @ camera().T_world_camera)]
    for number, seen_by in enumerate(cameras, 1):
        save(tmp_path / "in", number, CROWD, seen_by)
    rows = [" ".join(map(str, seen_by.T_world_camera.ravel())) for seen_by in cameras]
    (tmp_path / "in" / "poses.txt").write_text("\n".join(rows))
    predict(tmp_path / "in", tmp_path / "out")
    first, second = (records(tmp_path / "out")[f"view_{number}"] for number in (1, 2))
    assert len(second["tracks"]) == 3
    for before, after in zip(first["objects"], second["objects"], strict=True):
        assert before["id"] == after["id"]
        np.testing.assert_allclose(after["centre"], before["centre"], atol=0.03)
    np.testing.assert_allclose(second["camera"]["T_world_camera"], cameras[1].T_world_camera)
    centres = np.array([item["centre"] for item in second["objects"]])
    true = np.array([(np.array(item.lower) + item.upper) / 2 for item in CROWD])
    distances = np.linalg.norm(centres[:, None] - true[None], axis=-1)
    assert distances.min(axis=0).max() < 0.03


def test_the_command_line_and_python_track_alike(tmp_path, scenefw):
    """The tracker of `run=predict` makes no hypotheses where the run writes none."""
    words = ["reconstructor=hull_filling", "reconstructor.grid=${grid}", "device=cpu"]
    for number, boxes in enumerate((CROWD, CROWD[1:]), 1):
        save(tmp_path / "in", number, boxes)
    plain = ["run.hypotheses=false", "run.overview=false", "run.page=false", "paths.output=out"]
    done = scenefw("run=predict", "input=in", "run.track=true", *words, *plain)
    assert done.returncode == 0, done.stderr
    views = records(tmp_path / "out")
    for tracking in (load("tracking", *words), load("reconstruction", *words).track()):
        for name in ("view_1", "view_2"):
            prediction = tracking.predict(tmp_path / "in" / f"{name}.npz", name=name)
            assert views[name]["tracks"] == list(prediction.tracks)
    assert {track["state"] for track in prediction.tracks} == {"gone", "still"}


def test_without_an_option_that_tracks_one_line_says_so(tmp_path, scenefw):
    save(tmp_path / "in", 1, CROWD)
    words = ["run=predict", "input=in", "device=cpu", "reconstructor=hull_filling", "~tracking"]
    done = scenefw(*words, "run.track=true")
    assert done.returncode == 2
    assert done.stderr.startswith("error: run.track=true needs tracking=objects of the plugin")
    assert len(done.stderr.splitlines()) == 1
    done = scenefw(*words[:-1], "run.tracking=true")
    assert done.returncode == 2
    assert "run.tracking is true; expected a part" in done.stderr
