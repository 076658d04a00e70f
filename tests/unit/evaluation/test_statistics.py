import numpy as np
import pytest
from scipy import stats

from scenefw.evaluation.statistics import (
    bootstrap_interval,
    mean_interval,
    median_interval,
    paired_interval,
)


def test_bounds_are_those_of_scipy():
    values = np.random.default_rng(0).normal(0.9, 0.02, 27)
    found = mean_interval(values)
    low, high = stats.ttest_1samp(values, 0).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((low, high))
    assert (found.mean, found.count) == (pytest.approx(values.mean()), 27)


def test_bounds_hold_the_mean_as_often_as_they_say():
    rng = np.random.default_rng(1)
    held = [
        (i := mean_interval(rng.normal(0.5, 0.1, 6), 0.9)).low < 0.5 < i.high for _ in range(2000)
    ]
    assert np.mean(held) == pytest.approx(0.9, abs=0.025)


def test_few_values_have_no_bounds():
    assert np.isnan(mean_interval([]).mean)
    one = mean_interval([0.5, np.nan])
    assert (one.mean, one.count) == (0.5, 1)
    assert np.isnan(one.low)


def test_pairs_are_compared_scene_by_scene():
    hard = np.linspace(0.2, 0.9, 10)
    found = paired_interval(hard + 0.01, hard)
    assert found.mean == pytest.approx(0.01)
    assert 0 < found.low <= found.high < 0.011


def first(means):
    return means[..., 0]


def test_bootstrap_bounds_are_those_of_the_theory_for_many_scenes():
    rng = np.random.default_rng(0)
    values = rng.normal(3.0, 2.0, size=(400, 1))
    found = bootstrap_interval(values, range(400), first)
    reach = 1.96 * values.std() / 20
    assert found.mean == pytest.approx(values.mean())
    assert found.low == pytest.approx(values.mean() - reach, abs=0.1 * reach)
    assert found.high == pytest.approx(values.mean() + reach, abs=0.1 * reach)


def test_scenes_are_drawn_and_not_their_views():
    scenes = np.repeat(np.arange(30), 4)
    values = np.random.default_rng(1).normal(size=30)[scenes, None]
    once = bootstrap_interval(values[::4], range(30), first)
    often = bootstrap_interval(values, scenes, first)
    assert (often.low, often.high, often.count) == pytest.approx((once.low, once.high, 30))


def test_a_ratio_is_that_of_means():
    values = np.array([[1.0, 2.0], [3.0, 4.0], [np.nan, 1.0]])
    found = bootstrap_interval(values, [0, 1, 2], lambda m: m[..., 0] / m[..., 1])
    assert found.mean == pytest.approx(4 / 6)
    assert found.count == 2
    assert np.isnan(bootstrap_interval(values[2:], [2], first).mean)
    assert np.isnan(bootstrap_interval(values[:1], [0], first).low)


@pytest.mark.parametrize("confidence", [0.95, 0.6])
def test_bounds_of_a_median_are_those_of_scenes_drawn_one_by_one(confidence):
    random = np.random.default_rng(3)
    scenes = np.repeat(np.arange(40), random.integers(1, 6, 40))  # with one view or several
    values = random.exponential(size=40)[scenes] + 0.1 * random.random(len(scenes))
    found = median_interval(values, scenes, confidence)
    drawn = [
        np.median(np.concatenate([values[scenes == one] for one in random.integers(0, 40, 40)]))
        for _ in range(2000)
    ]
    edge = (1 - confidence) / 2
    low, high = np.quantile(drawn, [edge, 1 - edge])
    assert found.mean == np.median(values)
    assert found.low == pytest.approx(low, abs=0.1 * (high - low))
    assert found.high == pytest.approx(high, abs=0.1 * (high - low))
