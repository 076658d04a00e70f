"""The network is trained first, and scored alone on every set of views."""

from dataclasses import dataclass

from scenefw.report.page import Page
from scenefw.tasks import train_and_evaluate
from scenefw.tasks.train_and_evaluate import TrainAndEvaluate


class Training:
    def __init__(self, weights):
        self.weights = weights

    def run(self):
        self.weights.write_text("x")
        return {"train/steps": 2.0}


@dataclass
class Evaluation:
    score: float
    methods: dict

    def run(self, track):
        self.figures = {"iou": self.score}
        return self


def test_it_trains_then_scores_on_every_set(tmp_path, monkeypatch):
    weights = tmp_path / "weights"
    monkeypatch.setattr(train_and_evaluate, "load_checkpoint", lambda path: path.read_text())
    seen = []

    def evaluation(score):
        def make(methods):
            seen.append(methods)
            return Evaluation(score, methods)

        return make

    figures = TrainAndEvaluate(
        Training(weights),
        weights,
        lambda checkpoint: f"network of {checkpoint}",
        {"stacks": evaluation(0.5), "noisy": evaluation(0.25)},
        Page("Both"),
        tmp_path,
    ).run()
    assert figures == {"train/steps": 2.0, "stacks/iou": 0.5, "noisy/iou": 0.25}
    assert seen == [{"scenefw": "network of x"}] * 2
    assert (tmp_path / "report.html").exists()
