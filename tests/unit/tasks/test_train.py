import csv
import hashlib
import json
import signal

import pytest
import torch
from tests.unit.data.stacks_file import write_stacks
from tests.unit.learning import tiny

from scenefw.core.errors import CheckpointError, ConfigError, StorageError, TrainingError
from scenefw.core.signals import stop_of
from scenefw.data.batches.stacks import StackScenes
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.learning.optimizers import Muon
from scenefw.learning.runtime.trainer import TrainerSettings
from scenefw.losses.block_energy import BlockEnergy
from scenefw.losses.sample_spread import SampleSpread
from scenefw.losses.tsdf import TsdfLoss

TINY = "tests.unit.learning.tiny"


@pytest.fixture
def stacks(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return tmp_path / "stacks.npz"


def state(folder):
    return torch.load(folder / "state" / "last.ckpt", weights_only=True)


def same(first, second):
    if isinstance(first, torch.Tensor):
        return torch.equal(first, second)
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(same(first[k], second[k]) for k in first)
    if isinstance(first, (list, tuple)):
        return len(first) == len(second) and all(map(same, first, second))
    return first == second


def losses(folder):
    with (folder / "out" / "losses.csv").open(newline="") as file:
        return [(r["step"], r["epoch"], r["name"], r["value"]) for r in csv.DictReader(file)]


def test_a_killed_training_goes_on_as_if_never_stopped(stacks, tmp_path, run_elsewhere):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    done = run_elsewhere(TINY, stacks, whole)
    assert done.returncode == 0, done.stderr
    done = run_elsewhere(TINY, stacks, killed, "kill")
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert state(killed)["scenefw"]["batches_seen"] == 4  # the last snapshot before the kill at 5
    done = run_elsewhere(TINY, stacks, killed)
    assert done.returncode == 0, done.stderr
    first, second = state(whole), state(killed)
    assert first["global_step"] == second["global_step"] == 9
    assert same(first["state_dict"], second["state_dict"])
    assert same(first["optimizer_states"], second["optimizer_states"])
    assert same(first["scenefw"]["average"], second["scenefw"]["average"])
    assert losses(whole) == losses(killed)


@pytest.mark.parametrize(
    ("signals", "step"),
    [
        ([signal.SIGTERM], 5),
        ([signal.SIGINT, signal.SIGTERM], 4),  # the second one cuts the step short
    ],
)
def test_a_training_that_is_stopped_keeps_its_state_and_says_where(
    stacks, tmp_path, signals, step, capsys
):
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    stop = tiny.Signals(4, *signals)
    words = rf"kept in .*state/last\.ckpt, at step {step}; the same command resumes it$"
    with pytest.raises(stop_of(signals[-1]), match=words):
        tiny.task(stacks, tmp_path, steps=9, callbacks={"stop": stop}).run()
    assert state(tmp_path)["scenefw"]["batches_seen"] == step
    assert capsys.readouterr().err == "stopping after this step (Ctrl-C again: at once)\n"
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    assert tiny.task(stacks, tmp_path, steps=6).run()["train/steps"] == 6


@pytest.mark.exhaustive
def test_a_training_that_is_stopped_says_what_not_to_repeat(stacks, tmp_path):
    stop = {"stop": tiny.Signals(2, signal.SIGINT)}
    with pytest.raises(KeyboardInterrupt, match=r"this command without run\.fresh=true resumes"):
        tiny.task(stacks, tmp_path, steps=9, callbacks=stop, fresh=True).run()
    stop = {"stop": tiny.Signals(0, signal.SIGINT, signal.SIGINT)}
    with pytest.raises(KeyboardInterrupt, match="the training has no snapshot yet"):
        tiny.task(stacks, tmp_path / "new", steps=9, callbacks=stop).run()


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["-m", "seed=1,2"], "the same command with paths.output={out.parent} resumes it"),
        (["paths.output=out"], "the same command resumes it"),
    ],
)
def test_a_folder_named_by_the_time_is_said_to_be_given(stacks, tmp_path, command, said):
    """Otherwise the same command would begin anew, in a folder of its own."""
    given = tiny.task(stacks, tmp_path, 9, callbacks={"stop": tiny.Signals(2, signal.SIGINT)})
    given.folder = given.output / "training"
    given.output.mkdir()
    (given.output / "run.json").write_text(json.dumps({"command": command}))
    with pytest.raises(KeyboardInterrupt) as stopped:
        given.run()
    assert str(stopped.value).endswith(said.format(out=given.output))


@pytest.mark.parametrize(("steps", "said"), [(-1, True), (9, False)])
def test_a_training_without_a_limit_says_so(stacks, tmp_path, steps, said, capsys):
    stop = {"stop": tiny.Signals(1, signal.SIGINT)}
    with pytest.raises(KeyboardInterrupt):
        tiny.task(stacks, tmp_path, steps, callbacks=stop).run()
    assert ("this training has no limit" in capsys.readouterr().out) == said


@pytest.mark.exhaustive
def test_it_stops_and_goes_on_with_more_steps(stacks, tmp_path):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    tiny.task(stacks, whole, steps=5).run()
    tiny.task(stacks, parts, steps=3).run()
    figures = tiny.task(stacks, parts, steps=5).run()
    assert figures["train/steps"] == 5
    assert same(state(whole)["state_dict"], state(parts)["state_dict"])


def test_the_export_holds_the_averaged_weights(stacks, tmp_path, capsys):
    tiny.task(stacks, tmp_path, steps=4).run()
    assert capsys.readouterr().out.strip().splitlines()[-1].endswith("out/simstack.safetensors")
    found = load_checkpoint(tmp_path / "out" / "simstack.safetensors")
    average = state(tmp_path)["scenefw"]["average"]["values"]
    for name, value in found.model.state_dict().items():
        if value.is_floating_point():
            torch.testing.assert_close(value, average[name], rtol=1e-3, atol=1e-4)
    assert found.grid.resolution == 8
    assert found.metadata["steps"] == 4
    assert found.metadata["samples"] == 8


def test_the_export_says_how_it_was_made_and_from_what(stacks, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    command = ["run=train", "seed=0", "learning.initial=/home/me/w.safetensors", "paths.output=/o"]
    record = {"command": command, "versions": {"commit": "0123abc"}}
    (first / "out").mkdir(parents=True)
    (first / "out" / "run.json").write_text(json.dumps(record))
    tiny.task(stacks, first, steps=6).run()
    weights = first / "out" / "simstack.safetensors"
    before = load_checkpoint(weights).metadata
    expected = "python -m scenefw run=train seed=0 learning.initial=w.safetensors"
    assert before["command"] == expected
    assert before["commit"] == "0123abc"
    assert before["data"] == {"stacks": 8}
    assert before["epochs"] == 1.5
    assert (before["device"], before["precision"]) == ("cpu", "32-true")
    assert "started_from" not in before

    options = {"initial": weights, "reinitialise": ()}
    started = tiny.task(stacks, second, steps=2)
    started.learning = tiny.learning(**options)
    started.run()
    digest = hashlib.sha256(weights.read_bytes()).hexdigest()
    tiny.task(stacks, second, steps=3).run()  # gone on with, without a word of the first
    after = load_checkpoint(second / "out" / "simstack.safetensors").metadata
    assert after["steps"] == 3
    assert after["started_from"] == {"file": "simstack.safetensors", "sha256": digest, **before}


def test_the_name_of_the_weights_is_no_path(stacks, tmp_path):
    with pytest.raises(ConfigError, match=r"^run\.name is '\.\./x'; expected a plain file name"):
        tiny.task(stacks, tmp_path, steps=2, name="../x")


def test_fresh_starts_anew(stacks, tmp_path):
    tiny.task(stacks, tmp_path, steps=3).run()
    figures = tiny.task(stacks, tmp_path, steps=2, fresh=True).run()
    assert figures["train/steps"] == 2


def test_another_network_can_not_go_on(stacks, tmp_path):
    tiny.task(stacks, tmp_path, steps=2).run()
    with pytest.raises(CheckpointError, match=r"fresh=true"):
        tiny.task(stacks, tmp_path, steps=4, resolution=64).run()


def test_a_training_with_other_settings_can_not_go_on(stacks, tmp_path):
    tiny.task(stacks, tmp_path, steps=2).run()
    before = (tmp_path / "state" / "last.ckpt").read_bytes()
    for change in ({"seed": 1}, {"learning_rate": 3e-3}, {"optimizer": Muon(rate=3.0)}):
        other = tiny.task(stacks, tmp_path, steps=4)
        other.learning = tiny.learning(**change)
        with pytest.raises(CheckpointError, match=rf"{next(iter(change))} .* instead of"):
            other.run()
    other = tiny.task(stacks, tmp_path, steps=4)
    other.data.batch_size = 4
    with pytest.raises(CheckpointError, match="batch_size 2 instead of 4"):
        other.run()
    assert (tmp_path / "state" / "last.ckpt").read_bytes() == before
    validated = tiny.task(stacks, tmp_path, steps=4)
    validated.data.validation_scenes = StackScenes(str(stacks), "val", 1)
    assert validated.run()["train/steps"] == 4  # what watches a training may change


@pytest.mark.exhaustive
def test_weights_written_again_say_what_made_them(stacks, tmp_path):
    tiny.task(stacks, tmp_path, steps=3).run()
    before = load_checkpoint(tmp_path / "out" / "simstack.safetensors").metadata
    for folder in ("out", "state"):
        (tmp_path / folder / "simstack.safetensors").unlink()
    again = tiny.task(stacks, tmp_path, steps=3)
    again.trainer = TrainerSettings("cpu", max_steps=3, max_epochs=-1, precision="bf16-mixed")
    again.run()
    after = load_checkpoint(tmp_path / "out" / "simstack.safetensors").metadata
    assert after == before
    assert (after["samples"], after["precision"]) == (6, "32-true")


def test_losses_that_need_two_codes_are_found_before_the_work(stacks, tmp_path):
    task = tiny.task(stacks, tmp_path, steps=2)
    task.learning.model.zero_share = task.learning.model.prior_share = 0.0
    task.learning.losses["sample_spread"] = SampleSpread()
    with pytest.raises(ConfigError, match="sample_spread needs two codes"):
        task.run()
    assert not (tmp_path / "state").exists()
    task = tiny.task(stacks, tmp_path, steps=2)
    task.learning.model.prior_share = 0.5
    task.learning.losses["block_energy"] = BlockEnergy(block=3)
    with pytest.raises(ConfigError, match="block that divides"):
        task.run()


def test_a_damaged_state_is_one_line(stacks, tmp_path):
    tiny.task(stacks, tmp_path, steps=2).run()
    file = tmp_path / "state" / "last.ckpt"
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(CheckpointError, match="damaged") as caught:
        tiny.task(stacks, tmp_path, steps=4).run()
    assert "\n" not in str(caught.value)


def test_an_unwritable_folder_is_found_before_the_work(stacks, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    with pytest.raises(StorageError):
        tiny.task(stacks, blocked, steps=2).run()


class Undefined(TsdfLoss):
    def __call__(self, prediction, batch):
        return super().__call__(prediction, batch) * float("nan")


@pytest.mark.exhaustive
def test_a_training_that_diverges_keeps_its_last_snapshot(stacks, tmp_path):
    tiny.task(stacks, tmp_path, steps=2).run()
    before = state(tmp_path)
    task = tiny.task(stacks, tmp_path, steps=6)
    task.learning.losses["tsdf"] = Undefined()
    with pytest.raises(TrainingError, match=r"run\.fresh=true.*learning_rate") as caught:
        task.run()
    assert "\n" not in str(caught.value)
    assert state(tmp_path)["scenefw"]["batches_seen"] == 2
    assert same(state(tmp_path)["state_dict"], before["state_dict"])


def test_a_training_that_diverges_at_once_speaks_of_no_snapshot(stacks, tmp_path):
    task = tiny.task(stacks, tmp_path, steps=2)
    task.learning.losses["tsdf"] = Undefined()
    with pytest.raises(TrainingError, match=r"start over \(run\.fresh=true\)") as caught:
        task.run()
    assert "snapshot" not in str(caught.value)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_gpu_that_is_not_there_is_one_line(tmp_path):
    with pytest.raises(ConfigError, match="torch sees no GPU; give trainer=default"):
        TrainerSettings("cuda").build(tmp_path, [])
