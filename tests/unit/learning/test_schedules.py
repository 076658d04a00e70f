import pytest

from scenefw.core.errors import ConfigError
from scenefw.learning.runtime.limits import Budget
from scenefw.learning.runtime.trainer import TrainerSettings
from scenefw.learning.schedules import CosineDecay, ExponentialDecay, Progress, StepDecay


def test_the_thesis_drops_by_one_percent_every_five_epochs():
    factors = [StepDecay().factor(Progress(0, epoch, 0.0)) for epoch in (0, 4, 5, 9, 10, 129)]
    assert factors == pytest.approx([1, 1, 0.99, 0.99, 0.99**2, 0.99**25])


def test_cosine_ends_with_whichever_budget_is_nearer():
    schedule = CosineDecay(steps=100, minutes=2, warmup=0, lowest=0.1)
    assert schedule.factor(Progress(0, 0, 0.0)) == pytest.approx(1)
    assert schedule.factor(Progress(50, 0, 0.0)) == pytest.approx(0.55)
    assert schedule.factor(Progress(0, 0, 60.0)) == pytest.approx(0.55)
    assert schedule.factor(Progress(10, 0, 120.0)) == pytest.approx(0.1)
    assert schedule.factor(Progress(500, 0, 0.0)) == pytest.approx(0.1)


def test_warm_up_rises_evenly():
    schedule = CosineDecay(steps=10**9, warmup=4)
    factors = [schedule.factor(Progress(step, 0, 0.0)) for step in range(5)]
    assert factors == pytest.approx([0.25, 0.5, 0.75, 1, 1])


def test_a_cosine_needs_a_budget():
    with pytest.raises(ConfigError, match=r"steps, \.minutes"):
        CosineDecay()


def test_labels_lose_four_percent_every_hundred_thousand_steps():
    factors = [ExponentialDecay().factor(Progress(step, 0, 0.0)) for step in (0, 100_000, 250_000)]
    assert factors == pytest.approx([1, 0.96, 0.96**2.5])
    with pytest.raises(ConfigError, match="expected"):
        ExponentialDecay(decay=0)


def test_cosine_over_epochs_falls_within_them():
    schedule = CosineDecay(epochs=4, warmup=0, lowest=0.0)
    assert schedule.factor(Progress(10**6, 2, 0.0)) == pytest.approx(0.5)
    assert schedule.factor(Progress(0, 1, 0.0, 0.5)) > schedule.factor(Progress(0, 1, 0.0, 0.9))
    assert schedule.factor(Progress(0, 4, 0.0)) == pytest.approx(0)
    with pytest.raises(ConfigError, match="budget"):
        CosineDecay(epochs=-1)  # as the trainer writes: no limit


def test_how_much_of_a_budget_is_done():
    cosine = CosineDecay(steps=100, minutes=2.0, epochs=4)
    assert cosine.budget_share(Progress(0, 0, 0.0)) == 0
    assert cosine.budget_share(Progress(25, 0, 0.0)) == 0.25
    assert cosine.budget_share(Progress(25, 1, 90.0, 0.8)) == 0.75  # the time is nearest its end
    assert cosine.budget_share(Progress(25, 3, 90.0, 0.2)) == 0.8
    assert cosine.budget_share(Progress(500, 9, 1e4)) == 1
    assert (
        StepDecay().budget_share(Progress(0, 0, 0.0))
        == ExponentialDecay().budget_share(Progress(0, 0, 0.0))
        == 1
    )


def test_limits_of_minus_one_are_none_and_zero_is_an_error():
    with pytest.raises(ConfigError, match="budget"):
        CosineDecay(minutes=-1)
    assert CosineDecay(steps=10, minutes=-1).budget_share(Progress(5, 0, 1e6)) == 0.5
    for name in ("steps", "minutes", "epochs"):
        for wrong in (0, -2):
            with pytest.raises(ConfigError, match=f"^{name} = {wrong}"):
                CosineDecay(**{name: wrong})
    with pytest.raises(ConfigError, match="every = 0"):
        StepDecay(every=0)


def test_limits_of_a_training_of_minus_one_are_none_and_zero_is_an_error():
    assert TrainerSettings("cpu", max_epochs=-1, max_minutes=-1).budget == Budget()
    for name in ("max_steps", "max_minutes", "max_epochs"):
        for wrong in (0, -2):
            with pytest.raises(ConfigError, match=f"^{name} = {wrong}.*-1 for no limit"):
                TrainerSettings("cpu", **{name: wrong})
