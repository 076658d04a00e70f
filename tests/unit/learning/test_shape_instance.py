import lightning
import numpy as np
import pytest
import torch
from tests.unit.data.stacks_file import write_stacks
from tests.unit.learning import tiny

from scenefw.core.errors import ConfigError
from scenefw.learning.averaging import AveragedWeights
from scenefw.learning.schedules import CosineDecay
from scenefw.losses.sample_spread import SampleSpread


@pytest.fixture
def stacks(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return tmp_path / "stacks.npz"


@pytest.fixture
def data(stacks):
    return tiny.data(stacks, limit=2)


def trainer(steps, **options):
    return lightning.Trainer(
        accelerator="cpu",
        max_steps=steps,
        logger=False,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        limit_val_batches=0,
        **options,
    )


def test_it_learns_a_few_scenes(stacks):
    module = tiny.learning(16, schedule=None, learning_rate=2e-2)
    first = {}

    class First(lightning.Callback):
        def on_train_batch_end(self, trainer, module, *_):
            first.setdefault("total", float(trainer.callback_metrics["train/total"]))

    run = trainer(20, callbacks=[First()])
    run.fit(module, tiny.data(stacks, 16, limit=2))
    assert float(run.callback_metrics["train/total"]) < 0.6 * first["total"]
    assert module.batches_seen == 20
    assert module.seconds > 0


def test_the_learning_rate_follows_the_schedule(data):
    module = tiny.learning()
    rates = []

    class Rates(lightning.Callback):
        def on_train_batch_end(self, trainer, module, *_):
            rates.append(trainer.optimizers[0].param_groups[0]["lr"])

    trainer(6, callbacks=[Rates()]).fit(module, data)
    cosine = [0.01 + 0.99 * 0.5 * (1 + np.cos(np.pi * i / 20)) for i in range(6)]
    rise = [1 / 3, 2 / 3, 1, 1, 1, 1]
    np.testing.assert_allclose(rates, 1e-2 * np.array(cosine) * rise, rtol=1e-6)


def test_codes_are_drawn_from_a_share_of_the_budget_on(data):
    module = tiny.learning(draw_from=0.5, schedule=CosineDecay(steps=8, warmup=1))
    module.losses = {**module.losses, "sample_spread": SampleSpread()}
    module.model.zero_share, module.model.prior_share = 0.0, 0.5
    with_spread = []

    class Terms(lightning.Callback):
        def on_train_batch_end(self, trainer, module, *_):
            with_spread.append(float(trainer.callback_metrics.get("train/sample_spread", 0.0)) < 0)

    trainer(8, callbacks=[Terms()]).fit(module, data)
    assert with_spread == [False] * 4 + [True] * 4


def test_averaged_weights_are_a_moving_average():
    model = torch.nn.Linear(1, 1, bias=False)
    average = AveragedWeights(model, decay=0.9)
    expected = float(model.weight.detach())
    for i in range(30):
        with torch.no_grad():
            model.weight.fill_(i)
        average.update(model)
        decay = min(0.9, (2 + i) / (11 + i))
        expected = decay * expected + (1 - decay) * i
    with average.swapped(model):
        assert float(model.weight.detach()) == pytest.approx(expected, rel=1e-5)
    assert float(model.weight.detach()) == 29


def test_validation_scores_drawn_codes(stacks):
    run = trainer(1)
    module, data = tiny.learning(16), tiny.data(stacks, 16, limit=2)
    run.limit_val_batches = 1
    run.fit(module, data)
    first = run.validate(module, data, verbose=False)[0]
    again = run.validate(module, data, verbose=False)[0]
    assert first == again
    assert {"val/sample_iou", "val/sample_bce"} <= first.keys()


@pytest.mark.parametrize("share", [-0.1, 2.0])
def test_codes_can_only_be_drawn_within_the_budget(share):
    with pytest.raises(ConfigError, match="draw_from"):
        tiny.learning(draw_from=share)
