import numpy as np
import pytest
from scipy import stats

from scenefw.evaluation.statistics import mean_interval, paired_interval


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
