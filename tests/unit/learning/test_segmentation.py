import csv
import signal

import pytest
import torch
from tests.unit.data.rectangles import Rectangles
from tests.unit.learning import tiny_labels

from scenefw.core.errors import CheckpointError, ConfigError
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.losses.cross_entropy import CrossEntropy

TINY = "tests.unit.learning.tiny_labels"


def state(folder):
    return torch.load(folder / "state" / "last.ckpt", weights_only=True)


def rows(folder):
    with (folder / "out" / "losses.csv").open(newline="") as file:
        return [(r["step"], r["epoch"], r["name"], r["value"]) for r in csv.DictReader(file)]


def test_a_killed_training_goes_on_as_if_never_stopped(tmp_path, run_elsewhere):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    done = run_elsewhere(TINY, whole, 9)
    assert done.returncode == 0, done.stderr
    done = run_elsewhere(TINY, killed, 9, "kill")
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert state(killed)["scenefw"]["batches_seen"] == 4
    done = run_elsewhere(TINY, killed, 9)
    assert done.returncode == 0, done.stderr
    first, second = state(whole), state(killed)
    assert first["global_step"] == second["global_step"] == 9
    for name, value in first["state_dict"].items():
        assert torch.equal(value, second["state_dict"][name]), name
    average = second["scenefw"]["average"]["values"]
    for name, value in first["scenefw"]["average"]["values"].items():
        assert torch.equal(value, average[name]), name
    assert rows(whole) == rows(killed)


def test_a_training_on_rendered_views_in_two_calls_equals_one(tmp_path, run_elsewhere):
    """Five steps of four per epoch, cut within the first epoch."""
    for folder, calls in (("whole", [5]), ("parts", [3, 5])):
        for steps in calls:
            done = run_elsewhere(TINY, tmp_path / folder, steps, "rendered")
            assert done.returncode == 0, done.stderr
    first, second = state(tmp_path / "whole"), state(tmp_path / "parts")
    assert first["global_step"] == second["global_step"] == 5
    for name, value in first["state_dict"].items():
        assert torch.equal(value, second["state_dict"][name]), name


def test_it_learns_a_few_images(tmp_path):
    task = tiny_labels.task(tmp_path, steps=70, average=0.9)
    task.trainer.validate_every = 70
    figures = task.run()
    assert figures["val/miou"] > 0.9
    assert figures["val/red"] > 0.85
    assert figures["train/cross_entropy"] < 0.3
    found = load_checkpoint(tmp_path / "out" / "labels.safetensors", task="segmentation")
    assert found.metadata["classes"] == ["surface", "red", "blue"]
    assert found.metadata["input"] == "views"
    assert found.grid is None
    frame = next(Rectangles(seed=5).frames(0, 1))
    assert found.model.classes == 3
    assert frame.labels.max() == 2


def test_a_network_for_another_task_is_refused(tmp_path):
    tiny_labels.task(tmp_path, steps=1).run()
    with pytest.raises(CheckpointError, match="for segmentation, expected one for shape"):
        load_checkpoint(tmp_path / "out" / "labels.safetensors")
    with pytest.raises(CheckpointError, match="expected one for segmentation"):
        load_checkpoint(task="segmentation")


def test_network_and_data_have_the_same_classes(tmp_path):
    with pytest.raises(ConfigError, match=r"model\.classes=3"):
        tiny_labels.task(tmp_path, steps=1, classes=4).run()


def test_the_global_generator_is_left_alone(tmp_path):
    task = tiny_labels.task(tmp_path, steps=2)
    torch.manual_seed(7)
    expected = torch.rand(3)
    torch.manual_seed(7)
    task.run()
    assert torch.equal(torch.rand(3), expected)


def test_a_deeper_network_starts_from_a_shallower_one(tmp_path):
    tiny_labels.task(tmp_path, 2).run()
    weights = tmp_path / "out" / "labels.safetensors"
    before = load_checkpoint(weights, task="segmentation").model.state_dict()
    added = ["body.colour.2", "body.depth.2", "body.decoder.1"]
    deep = {"widths": (6, 8, 10), "initial": weights}
    after = tiny_labels.learning(**deep, reinitialise=added).model.state_dict()
    assert before.keys() < after.keys()
    assert all(torch.equal(after[name], value) for name, value in before.items())
    assert {".".join(n.split(".")[:3]) for n in after.keys() - before.keys()} == set(added)
    with pytest.raises(CheckpointError, match="a different network"):
        tiny_labels.learning(**deep)


def test_class_weights_are_found_wrong_before_the_work(tmp_path):
    task = tiny_labels.task(tmp_path, 2)
    task.learning.losses["cross_entropy"] = CrossEntropy(class_weights=[1.0, 2.0])
    with pytest.raises(ConfigError, match="2 numbers, but there are 3 classes"):
        task.run()
    assert not (tmp_path / "state").exists()
