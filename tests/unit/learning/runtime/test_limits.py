import csv

import pytest
import torch
from tests.unit.learning import plain

from scenefw.core.errors import ConfigError
from scenefw.learning.runtime.limits import Budget, Limits, finished, seconds_of


def rows(folder):
    with (folder / "out" / "losses.csv").open(newline="") as file:
        return [(r["step"], r["epoch"], r["name"], r["value"]) for r in csv.DictReader(file)]


def train_steps(folder):
    return [row for row in rows(folder) if row[2] == "train/total"]


def slice_of(folder, steps, call, **limits):
    """One call that ends when a clock that ticks once per step reaches `call`."""
    task = plain.task(folder, steps, **limits)
    ticks = [0.0]

    def clock():
        ticks[0] = max(ticks[0], float(task.learning.batches_seen) - first)
        return ticks[0]

    first = plain.state(folder)["scenefw"]["batches_seen"] if task._state.exists() else 0
    task.trainer.limits = lambda saving, began: Limits(task.trainer.budget, call, saving, clock)
    return task.run()


def test_a_training_in_slices_equals_one_in_a_single_call(tmp_path, capsys):
    whole, sliced = tmp_path / "whole", tmp_path / "sliced"
    plain.task(whole, steps=20, validate_every=0).run()
    seen = []
    while "finished" not in capsys.readouterr().out:
        slice_of(sliced, 20, 5.0, validate_every=0)
        seen.append(plain.state(sliced)["scenefw"]["batches_seen"])
        assert len(seen) < 10
    assert seen == [4, 8, 12, 16, 20, 20]  # a step of a second would not have fitted any more
    first, second = plain.state(whole), plain.state(sliced)
    assert first["global_step"] == second["global_step"] == 20
    for name, value in first["state_dict"].items():
        assert torch.equal(value, second["state_dict"][name]), name
    average = second["scenefw"]["average"]["values"]
    for name, value in first["scenefw"]["average"]["values"].items():
        assert torch.equal(value, average[name]), name
    moments = second["optimizer_states"][0]["state"]
    for number, value in first["optimizer_states"][0]["state"].items():
        for name in ("exp_avg", "exp_avg_sq", "step"):
            assert torch.equal(value[name], moments[number][name])
    assert rows(whole) == rows(sliced)


@pytest.mark.parametrize("call", [4.0, 7.0])
def test_slices_keep_count_of_epochs(tmp_path, call):
    """Of six steps each: wherever calls end, the budget of epochs is met by the same step."""
    for _ in range(9):
        slice_of(tmp_path, -1, call, max_epochs=3)
    assert plain.state(tmp_path)["scenefw"]["batches_seen"] == 18
    assert [int(r[1]) for r in train_steps(tmp_path)] == [0] * 6 + [1] * 6 + [2] * 6


def test_a_finished_training_says_so_and_its_weights_are_there(tmp_path, capsys):
    plain.task(tmp_path, steps=3).run()
    before = plain.state(tmp_path)
    (tmp_path / "out" / "plain.safetensors").unlink()
    (tmp_path / "state" / "plain.safetensors").unlink()  # a state that was carried alone
    capsys.readouterr()
    figures = plain.task(tmp_path, steps=3).run()
    said, where = capsys.readouterr().out.strip().splitlines()
    assert "the training is finished: 3 of 3 steps; to continue raise trainer.max_steps" in said
    assert where == str(tmp_path / "out" / "plain.safetensors")
    assert (tmp_path / "out" / "plain.safetensors").exists()
    assert figures["train/steps"] == 3
    assert plain.state(tmp_path)["global_step"] == before["global_step"]


def test_minutes_are_those_of_all_calls(tmp_path):
    task = plain.task(tmp_path, steps=-1, max_minutes=2.0)
    task.learning.clock.seconds = 119.999  # as if earlier calls had taken them
    task.run()
    stored = plain.state(tmp_path)["scenefw"]
    assert stored["seconds"] >= 120
    assert stored["batches_seen"] < 1000


def test_every_limit_that_is_met_is_named():
    stored = {"batches_seen": 24, "batches_per_epoch": 12, "seconds": 90.0}
    state = {"global_step": 24, "scenefw": stored}
    assert finished(Budget(), state) is None
    assert finished(Budget(25, 3, 2.0), state) is None
    assert "2 of 2 epochs; to continue raise trainer.max_epochs" in finished(Budget(25, 2), state)
    both = finished(Budget(24, None, 1.5), state)
    assert both.endswith("raise trainer.max_steps and trainer.max_minutes")
    assert "\n" not in both


def test_validation_and_saving_fit_into_a_call():
    now = [0.0]

    class Module:
        batches_seen, epochs_seen, seconds = 0, 0.0, 0.0

    class Trainer:
        world_size, global_step, should_stop = 1, 0, False

    trainer, module = Trainer(), Module()
    limits = Limits(Budget(), 100.0, lambda: 7.0, lambda: now[0])
    limits.on_train_start(trainer, module)
    limits.on_validation_start(trainer, module)
    now[0] = 20.0
    limits.on_validation_end(trainer, module)
    for now[0] in (22.0, 24.0, 70.0):  # the last step took 46 s
        limits.on_train_batch_end(trainer, module)
        if now[0] == 24.0:
            assert not trainer.should_stop
    assert trainer.should_stop  # 70 + 46 + 20 + 7 > 100


def test_a_time_is_written_in_one_way():
    assert seconds_of("01:02:03:04") == 93784
    assert seconds_of(None) is None
    with pytest.raises(ConfigError, match="DD:HH:MM:SS"):
        seconds_of("9 minutes")
