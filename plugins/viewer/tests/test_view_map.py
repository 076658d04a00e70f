import socket

import pytest
from tests.unit.tasks.recordings import CLASSES, frames, table
from tests.unit.tasks.test_label import label

from scenefw.core.errors import ConfigError, InputError
from scenefw.data.files.height_maps import load_map, save_map
from scenefw.data.files.sequences import write_sequence
from scenefw_viewer import view_map
from scenefw_viewer.map_viewer import MapViewer
from scenefw_viewer.view_map import ViewMap, is_map

pytest.importorskip("viser")


@pytest.fixture
def shown(monkeypatch):
    """Titles of all maps that were shown, and what was said."""
    seen = []

    class Kept(MapViewer):
        def show(self, height_map, title, frame=None):
            super().show(height_map, title, frame)
            seen.append((title, frame is not None))

        def say(self, status):
            super().say(status)
            seen.append(status)

    monkeypatch.setattr(view_map, "MapViewer", Kept)
    return seen


def test_a_recording_grows_and_leaves_what_labelling_leaves(tmp_path, shown, capsys):
    folder = write_sequence(tmp_path / "recording", frames(), CLASSES)
    task = ViewMap(label(folder, tmp_path / "out"), every=2, port=0, seconds=0.1)
    figures = task.run()
    assert figures["frames"] == 6
    titles = [("1 frame", True), ("3 frames", True), ("5 frames", True), ("6 frames", True)]
    assert shown[1:-1] == titles
    assert (shown[0], shown[-1].split(";")[0]) == ("frames are being added", "all frames are in")
    assert load_map(tmp_path / "out" / "map.npz").height_map.labels is not None
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("http://127.0.0.1:")
    assert lines[-1] == "viewer ended"


def test_a_saved_map_is_shown_without_labelling(tmp_path, shown):
    path = save_map(tmp_path / "map.npz", table())
    assert is_map(path)
    figures = ViewMap(label(path, tmp_path / "out"), port=0, seconds=0.1).run()
    assert figures == {"coverage": 1.0}
    assert shown == [("map.npz", False), "a saved map"]
    assert not (tmp_path / "out").exists()


def test_ctrl_c_while_frames_are_added_keeps_the_map(tmp_path, shown, monkeypatch, capsys):
    folder = write_sequence(tmp_path / "recording", frames(), CLASSES)

    def interrupted(self, height_map, title, frame=None):
        if title.startswith("3"):
            raise KeyboardInterrupt

    monkeypatch.setattr(view_map.MapViewer, "show", interrupted)
    ViewMap(label(folder, tmp_path / "out"), every=2, port=0).run()
    assert (tmp_path / "out" / "map.npz").is_file()
    assert capsys.readouterr().out.splitlines()[-1] == "viewer ended"


def test_bad_settings_and_inputs_are_one_line(tmp_path):
    task = label(tmp_path / "none", tmp_path / "out")
    with pytest.raises(ConfigError, match=r"run\.every"):
        ViewMap(task, every=0)
    with pytest.raises(ConfigError, match=r"run\.seconds"):
        ViewMap(task, seconds=0)
    with pytest.raises(InputError, match="none"):
        ViewMap(task, port=0).run()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(ConfigError, match="in use"):
            ViewMap(task, port=taken.getsockname()[1]).run()
    (tmp_path / "text.npz").write_text("no map")
    assert not is_map(tmp_path / "text.npz")
    assert not is_map(tmp_path / "missing.npz")
