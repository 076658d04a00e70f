import sys

import numpy as np
import pytest
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.tasks.recordings import CLASSES, frames
from tests.unit.tasks.test_label import label
from tests.unit.tasks.test_predict import save

from scenefw.core.errors import InputError, MissingDependencyError, SettingError
from scenefw.core.types import GridSpec
from scenefw.data.files.sequences import write_sequence
from scenefw_rerun.tasks import RecordMap, RecordPrediction
from scenefw_viewer.view import View


def view(image, output):
    return View(image, pipeline_of(KnownBoxes(GridSpec(resolution=32)), samples=2), output)


def entities(path):
    """Chunks of a recording: entity and timelines of each, as Rerun itself reads them back."""
    pytest.importorskip("rerun", reason="needs rerun-sdk (pip install 'scenefw[rerun]')")
    from rerun.chunk import RrdReader

    chunks = list(RrdReader(path).stream().to_chunks())
    return {(chunk.entity_path, tuple(chunk.timeline_names)) for chunk in chunks}


def test_a_prediction_is_recorded_with_its_hypotheses(tmp_path):
    pytest.importorskip("rerun", reason="needs rerun-sdk (pip install 'scenefw[rerun]')")
    figures = RecordPrediction(view(save(tmp_path / "view.npz"), tmp_path / "out")).run()
    assert figures["images"] == 1
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["view.rrd"]
    found = entities(tmp_path / "out" / "view.rrd")
    paths = {path for path, _ in found}
    expected = {"/world/objects/object_01", "/world/objects/object_02", "/world/camera", "/scene"}
    assert expected <= paths
    assert any(path == "/scene" and "hypothesis" in lines for path, lines in found)


def test_a_labelled_sequence_is_recorded_over_time(tmp_path):
    pytest.importorskip("rerun", reason="needs rerun-sdk (pip install 'scenefw[rerun]')")
    folder = write_sequence(tmp_path / "recording", frames(3), CLASSES)
    figures = RecordMap(label(folder, tmp_path / "out", picture_every=None), every=2).run()
    assert figures["frames"] == 3
    assert (tmp_path / "out" / "map.npz").is_file()
    found = entities(tmp_path / "out" / "map.rrd")
    assert any(path == "/world/map/labels" and "map" in lines for path, lines in found)


def test_without_the_library_the_install_line_is_said_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    for task in (
        RecordPrediction(view(tmp_path / "nothing.npz", tmp_path / "out")),
        RecordMap(label(tmp_path / "nothing", tmp_path / "out")),
    ):
        with pytest.raises(MissingDependencyError, match=r"pip install 'scenefw\[rerun\]'"):
            task.run()


def test_what_is_unusable_leaves_no_recording(tmp_path):
    pytest.importorskip("rerun", reason="needs rerun-sdk (pip install 'scenefw[rerun]')")
    image = save(tmp_path / "view.npz", depth_mm=np.zeros((120, 160)))
    with pytest.raises(InputError):
        RecordPrediction(view(image, tmp_path / "out")).run()
    assert list((tmp_path / "out").iterdir()) == []
    with pytest.raises(SettingError):
        RecordMap(label(tmp_path, tmp_path / "out"), every=0)
