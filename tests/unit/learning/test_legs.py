"""Legs of one training with other batches, and weights that meet a fresh optimiser."""

import pytest
import torch
from tests.unit.learning import plain

from scenefw.core.errors import CheckpointError, ConfigError, TrainingError
from scenefw.learning.runtime import trainer
from scenefw.learning.runtime.trainer import TrainerSettings
from scenefw.learning.schedules import ExponentialDecay, Progress, StepDecay


@pytest.fixture
def _told(monkeypatch):
    monkeypatch.setattr(plain.Data, "facts", lambda self: {"batch_size": self.batch_size})


def leg(folder, steps, batch_size, may_change=()):
    task = plain.task(folder, steps=steps, batch_size=batch_size)
    task.learning.may_change = task.may_change = may_change
    seen = []
    made = task.data.training_batch
    task.data.training_batch = lambda batch, device: (seen.append(batch), made(batch, device))[1]
    task.run()
    return task, [(batch.epoch, len(batch.indices), *batch.indices.tolist()) for batch in seen]


@pytest.mark.usefixtures("_told")
def test_a_leg_with_other_batches_goes_on_where_the_samples_are(tmp_path):
    """24 samples: 4 batches of 4 are 16, so that batches of 8 begin with the last of epoch 0."""
    _, before = leg(tmp_path, 4, 4)
    task, after = leg(tmp_path, 7, 8, ("batch_size",))
    assert [(epoch, count) for epoch, count, *_ in after] == [(0, 8), (1, 8), (1, 8)]
    first = {number for _, _, *numbers in before + after[:1] for number in numbers}
    assert first == set(range(24)), "each sample of the epoch once"
    progress = plain.state(tmp_path)["scenefw"]
    assert progress["samples_seen"] == 16 + 24
    assert progress["epochs_seen"] == pytest.approx(40 / 24)
    assert task.learning.epochs_seen == pytest.approx(40 / 24)
    moments = plain.state(tmp_path)["optimizer_states"][0]["state"]
    assert {int(own["step"]) for own in moments.values()} == {7}


@pytest.mark.usefixtures("_told")
def test_a_leg_and_back_is_counted_in_samples(tmp_path):
    leg(tmp_path, 2, 8, ("batch_size",))
    leg(tmp_path, 4, 4, ("batch_size",))
    _, batches = leg(tmp_path, 5, 8, ("batch_size",))
    assert [(epoch, count) for epoch, count, *_ in batches] == [(1, 8)]


@pytest.mark.usefixtures("_told")
def test_other_batches_must_be_allowed(tmp_path):
    leg(tmp_path, 2, 8)
    with pytest.raises(CheckpointError, match=r"batch_size 8 instead of 4.*run\.may_change=\[b"):
        leg(tmp_path, 4, 4)
    with pytest.raises(ConfigError, match="may_change names batches; the facts of this training"):
        leg(tmp_path, 4, 4, ("batches",))


@pytest.mark.parametrize("schedule", [StepDecay, ExponentialDecay])
def test_a_warm_up_rises_to_the_schedule(schedule):
    plainly, warm = schedule(0.5, 2), schedule(0.5, 2, warmup=10)
    for step in (0, 4, 9, 10, 100):
        progress = Progress(step, step // 5, 0.0)
        rise = min((step + 1) / 10, 1.0)
        assert warm.factor(progress) == pytest.approx(rise * plainly.factor(progress))


@pytest.mark.parametrize(("able", "name"), [(True, "bf16-mixed"), (False, "32-true")])
def test_precision_follows_the_instructions_of_the_processor(tmp_path, monkeypatch, able, name):
    monkeypatch.setattr(trainer, "_multiplies_bfloat16", lambda: able)
    settings = TrainerSettings(accelerator="cpu", precision="auto")
    assert settings.precision == name
    assert settings.build(tmp_path, []).precision == name


def test_losses_are_compiled_with_the_network(tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(torch, "compile", lambda call, backend: calls.append(backend) or call)
    task = plain.task(tmp_path, steps=2, learning={"compile": "eager"})
    monkeypatch.setattr(task.learning.model, "compile", lambda backend: calls.append(backend))
    task.run()
    assert calls == ["eager", "eager"]


def test_a_gpu_that_is_gone_leaves_the_newest_state(tmp_path, monkeypatch):
    plain.task(tmp_path, steps=2).run()
    before = (tmp_path / "state" / "last.ckpt").read_bytes()
    task = plain.task(tmp_path, steps=9)

    def fail(batch):
        raise torch.AcceleratorError("CUDA error: unspecified launch failure\nmore lines")

    monkeypatch.setattr(task.learning, "predict_batch", fail)
    with pytest.raises(TrainingError, match=r"launch failure\); .* at step 2; the same command"):
        task.run()
    assert (tmp_path / "state" / "last.ckpt").read_bytes() == before
