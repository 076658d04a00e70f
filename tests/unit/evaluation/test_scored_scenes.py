import json
import threading
from dataclasses import dataclass

import pytest

from scenefw.evaluation.kept_rows import KeptRows
from scenefw.evaluation.scored_scenes import scored_scenes, workers_on


@dataclass(frozen=True)
class Square:
    number: int
    square: int


class Scorer:
    """Squares, and which scenes it was asked for; stops like a killed run before one of them."""

    def __init__(self, stop_at=None):
        self.stop_at, self.asked, self.lock = stop_at, [], threading.Lock()

    def __call__(self, scene):
        if scene == self.stop_at:
            raise KeyboardInterrupt
        with self.lock:
            self.asked.append(scene)
        return Square(scene, scene**2)


def track(items, what):
    assert what == "scenes"
    return items


EXPECTED = [Square(i, i * i) for i in range(300)]


@pytest.mark.parametrize("workers", [1, 3])
def test_scenes_are_scored_in_their_order(workers):
    scorer = Scorer()
    assert scored_scenes(scorer, 300, None, track, workers=workers) == EXPECTED
    assert sorted(scorer.asked) == list(range(300))


def test_what_an_interrupted_run_has_scored_is_not_scored_again(tmp_path):
    (tmp_path / "config.yaml").write_text("a: 1\n")
    (tmp_path / "run.json").write_text(json.dumps({"weights": {}, "versions": {}, "command": []}))
    with pytest.raises(KeyboardInterrupt):
        scored_scenes(Scorer(280), 300, None, track, KeptRows(tmp_path), workers=1)
    again = Scorer()
    found = scored_scenes(
        again, 300, lambda row: Square(**row), track, KeptRows(tmp_path), workers=1
    )
    assert found == EXPECTED
    assert again.asked == list(range(280, 300))


def test_a_gpu_has_one_worker_unless_more_are_asked_for():
    assert workers_on("cpu", None) is None
    assert workers_on("cuda", None) == 1
    assert workers_on("cuda:1", 3) == 3
    assert workers_on("cpu", 2) == 2
