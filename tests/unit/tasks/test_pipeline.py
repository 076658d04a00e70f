"""The order of the parts, and what they leave."""

import json

import pytest

from scenefw.core.errors import CheckpointError
from scenefw.core.measures import Measure
from scenefw.report.blocks import Picture, Section, Text
from scenefw.report.nothing import NoShowcase
from scenefw.report.page import Page
from scenefw.report.presentation import Figures
from scenefw.tasks.pipeline import Pipeline


class _Parts:
    """All parts of a pipeline; notes in which order they are used."""

    figures = {"chamfer_full": 0.03}  # noqa: RUF012
    measures = {"chamfer_full": Measure("Chamfer")}  # noqa: RUF012

    def __init__(self, folder):
        self.folder, self.order = folder, []

    def show(self):
        self.order.append("gallery" if "evaluate" in self.order else "data")
        if self.order[-1] == "gallery":
            return (Picture("gallery/a.jpg", "scene 1"),)
        return (Section("Simulated stacks", (Text("3 stacks"),)),), {"stacks/scenes": 3.0}

    def run(self, track=None):
        if track is None:
            self.order.append("train")
            (self.folder / "losses.csv").write_text(
                "step,epoch,seconds,name,value\n1,0,1,train/tsdf,0.5\n"
            )
            return {"train/steps": 1.0, "train/seconds": 2.0, "train/parameters": 3e6}
        self.order.append("evaluate")
        return self

    def evaluation(self):
        self.order.append("build")
        return self


@pytest.fixture
def parts(tmp_path):
    return _Parts(tmp_path)


def _pipeline(parts, **changes):
    arguments = {
        "showcase": parts,
        "train": parts,
        "losses": parts.folder / "losses.csv",
        "evaluation": parts.evaluation,
        "presentation": Figures(),
        "gallery": parts,
        "page": Page("All of it"),
        "output": parts.folder,
    }
    return Pipeline(**arguments | changes)


def test_data_training_evaluation_and_examples_on_one_page(parts):
    figures = _pipeline(parts).run()
    assert parts.order == ["data", "train", "build", "evaluate", "gallery"]
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
    measures = json.loads((parts.folder / "measures.json").read_text())
    assert {"chamfer_full", "train/parameters"} <= measures.keys()


def test_data_need_not_be_shown(parts):
    assert "stacks/scenes" not in _pipeline(parts, showcase=NoShowcase()).run()
    assert "Simulated stacks" not in (parts.folder / "report.html").read_text()


def test_an_unusable_folder_is_found_before_the_training(parts, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(Exception, match="cannot write"):
        _pipeline(parts, output=blocked / "out").run()
    assert parts.order == []


def test_errors_of_the_weights_pass_through(parts):
    def broken():
        raise CheckpointError("truncated")

    with pytest.raises(CheckpointError, match="truncated"):
        _pipeline(parts, evaluation=broken).run()
