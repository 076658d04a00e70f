import json

import pytest

from scenefw.core.errors import ConfigError, StorageError
from scenefw.data.batches.stacks import StackScenes
from scenefw.scenes.cameras import RandomViewpoints
from scenefw_annotated_views.coco import COCO
from scenefw_annotated_views.scenes import StackViews
from scenefw_annotated_views.task import ExportDataset
from scenefw_sweeps.local import Local


def source(scenes=3):
    return StackViews(StackScenes("stacks_v2", "test", scenes), RandomViewpoints(32, 24), detail=4)


class Stopping(COCO):
    """Stops in the second scene."""

    def write_scene(self, folder, views, numbers):
        super().write_scene(folder, views, numbers)
        if folder.name == "000001":
            raise StorageError("disk full")


Stopping.__qualname__ = "COCO"  # it writes the same


def test_a_run_that_was_stopped_goes_on(tmp_path, capsys):
    with pytest.raises(StorageError, match="disk full"):
        ExportDataset(source(), Stopping(), Local(1), tmp_path, count=2).run()
    assert sorted(p.name for p in (tmp_path / "test").iterdir()) == ["000000"]
    first = tmp_path / "test" / "000000" / "annotations.json"
    before = first.stat().st_mtime_ns
    figures = ExportDataset(source(), COCO(), Local(1), tmp_path, count=2).run()
    assert first.stat().st_mtime_ns == before
    assert figures["scenes"] == 3
    assert figures["views"] == 6
    assert figures["objects"] == figures["models"] == sum(len(source().keys(s)) for s in range(3))
    whole = tmp_path / "whole"
    ExportDataset(source(), COCO(), Local(1), whole, count=2).run()
    name = "annotations_test.json"
    assert (whole / name).read_text() == (tmp_path / name).read_text()
    assert len(json.loads((whole / name).read_text())["images"]) == 6


def test_a_folder_of_other_settings_is_not_mixed(tmp_path):
    ExportDataset(source(1), COCO(), Local(1), tmp_path, count=1).run()
    for other in ({"count": 2}, {"views": source(2)}):
        words = {"views": source(1), "format": COCO(), "count": 1, **other}
        with pytest.raises(ConfigError, match="data set of other settings"):
            ExportDataset(parallel=Local(1), output=tmp_path, **words).run()
    with pytest.raises(ConfigError, match=r"run\.count = 0"):
        ExportDataset(source(1), COCO(), Local(1), tmp_path, count=0)
