import csv
import sys

import pytest
from tests.unit.learning import plain

from scenefw.learning.runtime.loggers import LossTable, TensorBoard


def curve(folder, name):
    """Points of a curve as TensorBoard itself reads them."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    found = EventAccumulator(str(folder))
    found.Reload()
    return [(event.step, event.value) for event in found.Scalars(name)]


def table(path, name):
    with path.open(newline="") as file:
        return [(int(r["step"]), r["value"]) for r in csv.DictReader(file) if r["name"] == name]


def fill(logger, folder, begin, steps):
    logger.begin(folder, begin)
    for step in steps:
        logger.log(step, step // 2, 0.1 * step, {"train/total": 1 / step + begin})
    logger.end()


def test_a_table_resumes_after_a_step(tmp_path):
    fill(LossTable(), tmp_path, 0, [1, 2, 3, 4])
    fill(LossTable(), tmp_path, 2, [3])
    assert table(tmp_path / "losses.csv", "train/total") == [(1, "1"), (2, "0.5"), (3, "2.33333")]
    fill(LossTable(), tmp_path, 0, [1])
    assert table(tmp_path / "losses.csv", "train/total") == [(1, "1")]


def test_curves_resume_after_a_step(tmp_path):
    fill(TensorBoard(), tmp_path, 0, [1, 2, 3, 4])
    fill(TensorBoard(), tmp_path, 2, [3])
    found = curve(tmp_path / "tensorboard", "train/total")
    assert found == [(1, 1.0), (2, 0.5), (3, pytest.approx(2 + 1 / 3))]


def test_without_the_package_one_line_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    fill(TensorBoard(), tmp_path, 0, [1])
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install tensorboard" in line
    assert list(tmp_path.iterdir()) == []


def test_all_loggers_get_the_same_means(tmp_path):
    task = plain.task(tmp_path, steps=6)
    task.loggers = {"csv": LossTable(), "tensorboard": TensorBoard()}
    task.log_every = 2
    task.run()
    rows = table(tmp_path / "state" / "losses.csv", "train/total")
    points = curve(tmp_path / "state" / "tensorboard", "train/total")
    assert [step for step, _ in rows] == [step for step, _ in points] == [2, 4, 6]
    for (_, text), (_, value) in zip(rows, points, strict=True):
        assert float(text) == pytest.approx(value, rel=1e-5)
    assert curve(tmp_path / "state" / "tensorboard", "val/error")
