"""Two processes of a tiny training, joined by gloo."""

import csv

import pytest
import torch
from tests.unit.learning import plain

from scenefw.core.errors import ConfigError
from scenefw.learning.runtime.trainer import TrainerSettings

PLAIN = "tests.unit.learning.plain"


@pytest.fixture(scope="module")
def folders(tmp_path_factory, run_elsewhere):
    """Eight steps of two processes, in a single call and in two.

    The single one starts its second process as scenefw does; the others copy theirs, as a new one
    takes seconds to import torch.
    """
    folder = tmp_path_factory.mktemp("folder")
    whole, parts = folder / "whole", folder / "parts"
    for how, where, steps in (("spawn", whole, 8), ("fork", parts, 3), ("fork", parts, 8)):
        done = run_elsewhere(PLAIN, how, where, steps)
        assert done.returncode == 0, done.stderr
        said = str(where / "out" / "plain.safetensors")
        assert done.stdout.split() == [said]  # by the first process alone
    return whole, parts


@pytest.fixture
def whole(folders):
    return folders[0]


def kept(folder, rank):
    return torch.load(folder / f"process_{rank}.pt", weights_only=True)


@pytest.mark.exhaustive
def test_weights_agree(whole):
    first, second = (kept(whole, rank)["weights"] for rank in (0, 1))
    assert all(torch.equal(value, second[name]) for name, value in first.items())
    stored = plain.state(whole)["state_dict"]
    assert all(torch.equal(value, stored[f"model.{name}"]) for name, value in first.items())


@pytest.mark.exhaustive
def test_the_gradient_is_that_of_both_batches_together(whole, tmp_path):
    plain.task(tmp_path, steps=8, batch_size=4).run()
    both, alone = kept(whole, 0)["gradients"], kept(tmp_path, 0)["gradients"]
    assert len(both) == len(alone) == 8
    for mine, expected in zip(both, alone, strict=True):
        for gradient, one in zip(mine, expected, strict=True):
            torch.testing.assert_close(gradient, one, rtol=1e-4, atol=1e-6)


@pytest.mark.exhaustive
def test_a_resumed_training_equals_an_uninterrupted_one(folders):
    first, second = map(plain.state, folders)
    assert first["global_step"] == second["global_step"] == 8
    for name, value in first["state_dict"].items():
        assert torch.equal(value, second["state_dict"][name]), name
    tables = []
    for folder in folders:
        with (folder / "out" / "losses.csv").open(newline="") as file:
            rows = [r for r in csv.DictReader(file) if r["name"] == "train/total"]
        tables.append([(r["step"], r["epoch"], r["value"]) for r in rows])
    assert tables[0] == tables[1]
    assert len(tables[0]) == 8


@pytest.mark.exhaustive
def test_a_process_that_fails_ends_all(tmp_path, run_elsewhere):
    done = run_elsewhere(PLAIN, "fork", tmp_path / "failing", 8)
    assert done.returncode == 1
    expected = "TrainingError: process 1 of 2 failed: ValueError: no more numbers"
    assert done.stderr.strip().splitlines()[-1].endswith(expected)
    assert not (tmp_path / "failing" / "out" / "plain.safetensors").exists()


def test_how_many_processes_there_are():
    assert TrainerSettings("cpu", "auto").processes == 1
    assert TrainerSettings("cpu", 3).processes == 3
    assert TrainerSettings("cuda", [0, 2]).processes == 2
    assert TrainerSettings("cuda:1", "auto").processes == 1
    with pytest.raises(ConfigError, match=r"trainer\.devices=many"):
        _ = TrainerSettings("cpu", "many").processes
