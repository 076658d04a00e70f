"""The network is trained first; only then the evaluation, which reads its weights, is built."""

import json

import pytest

from scenefw.core.errors import ConfigError
from scenefw.core.measures import Measure
from scenefw.report.page import Page
from scenefw.report.presentation import Figures
from scenefw.tasks.train_and_evaluate import TrainAndEvaluate


class Training:
    def __init__(self, weights):
        self.weights = weights

    def run(self):
        self.weights.write_text("0.5")
        return {"train/steps": 2.0}


class Evaluation:
    measures = {"iou": Measure("IoU", better="higher")}  # noqa: RUF012

    def __init__(self, weights):
        self.score = float(weights.read_text())  # fails before the training

    def run(self, track):
        self.figures = {"iou": self.score}
        return self


def task(folder, **changes):
    weights = folder / "weights"
    arguments = {
        "train": Training(weights),
        "evaluation": lambda: Evaluation(weights),
        "presentation": Figures(),
        "gallery": lambda: None,
        "page": Page("Both"),
        "output": folder,
        "weights": weights,
        "checkpoint": weights,
    }
    return TrainAndEvaluate(**arguments | changes)


def test_it_trains_then_evaluates_what_it_trained(tmp_path):
    assert task(tmp_path).run() == {"train/steps": 2.0, "iou": 0.5}
    assert "IoU" in (tmp_path / "report.html").read_text()
    measures = json.loads((tmp_path / "measures.json").read_text())
    assert measures["iou"]["heading"] == "IoU"
    assert measures["train/steps"]["heading"] == "steps"


@pytest.mark.parametrize("checkpoint", [None, "others"])
def test_other_weights_are_refused_before_the_training(tmp_path, checkpoint):
    with pytest.raises(ConfigError, match=f"not {checkpoint}; .*learning.initial"):
        task(tmp_path, checkpoint=checkpoint)
