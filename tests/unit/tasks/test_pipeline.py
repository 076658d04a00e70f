"""The order of the parts, and who is compared with whom."""

import pytest

from scenefw.core.errors import CheckpointError
from scenefw.report.blocks import Picture, Section, Text
from scenefw.report.page import Page
from scenefw.tasks import pipeline
from scenefw.tasks.pipeline import Pipeline


class _Parts:
    """All parts of a pipeline; notes in which order they are used."""

    def __init__(self, folder):
        self.folder, self.order = folder, []

    def show(self):
        self.order.append("gallery" if "evaluate" in self.order else "stacks")
        if self.order[-1] == "gallery":
            return (Picture("gallery/a.jpg", "scene 1"),)
        return Section("Simulated stacks", (Text("3 stacks"),)), {"stacks/scenes": 3.0}

    def run(self, track=None):
        if track is None:
            self.order.append("train")
            (self.folder / "weights").write_text("x")
            (self.folder / "losses.csv").write_text(
                "step,epoch,seconds,name,value\n1,0,1,train/tsdf,0.5\n"
            )
            return {"train/steps": 1.0, "train/seconds": 2.0, "train/parameters": 3e6}
        self.order.append("evaluate")
        return self

    figures = {"chamfer_full": 0.03}  # noqa: RUF012

    def evaluation(self, methods):
        self.methods = methods
        return self


@pytest.fixture
def parts(tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "load_checkpoint", lambda path: f"checkpoint {path.name}")
    return _Parts(tmp_path)


def _pipeline(parts, **changes):
    arguments = {
        "stacks": parts,
        "train": parts,
        "weights": parts.folder / "weights",
        "losses": parts.folder / "losses.csv",
        "network": lambda checkpoint: f"network of {checkpoint}",
        "evaluation": parts.evaluation,
        "methods": {"scenefw": "shipped", "partial_tsdf": "reference"},
        "gallery": parts,
        "page": Page("All of it"),
        "output": parts.folder,
    }
    return Pipeline(**arguments | changes)


def test_the_trained_network_is_scored_beside_the_shipped_one(parts):
    figures = _pipeline(parts).run()
    assert parts.order == ["stacks", "train", "evaluate", "gallery"]
    assert parts.methods == {
        "scenefw": "shipped",
        "trained_here": "network of checkpoint weights",
        "partial_tsdf": "reference",
    }
    assert list(parts.methods)[0] == "scenefw"  # its figures carry no prefix  # noqa: RUF015
    assert figures == {
        "chamfer_full": 0.03,
        "stacks/scenes": 3.0,
        "train/steps": 1.0,
        "train/seconds": 2.0,
        "train/parameters": 3e6,
    }
    page = (parts.folder / "report.html").read_text()
    for text in ("All of it", "1 steps in 2 s", "3.0 million", "<svg", "3 stacks", "gallery/a.jpg"):
        assert text in page


def test_an_unusable_folder_is_found_before_the_training(parts, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(Exception, match="cannot write"):
        _pipeline(parts, output=blocked / "out").run()
    assert parts.order == []


def test_errors_of_the_weights_pass_through(parts, monkeypatch):
    def broken(path):
        raise CheckpointError("truncated")

    monkeypatch.setattr(pipeline, "load_checkpoint", broken)
    with pytest.raises(CheckpointError, match="truncated"):
        _pipeline(parts).run()
