import itertools

import numpy as np
import pytest
from scipy import stats

from scenefw_scene_prior.two_samples import energy_distance, permutation_test


def sample(count, shift=0.0, columns=1, seed=0):
    return np.random.default_rng(seed).normal(shift, 1.0, (count, columns))


def test_it_is_scipys_energy_distance_without_bias():
    """In one dimension, scipy's is the root of the same sum, with pairs of a row and itself."""
    x, y = sample(40), sample(60, 0.8, seed=1)
    biased = stats.energy_distance(x[:, 0], y[:, 0]) ** 2
    inner = [np.abs(one - one.T).sum() / len(one) ** 2 / (len(one) - 1) for one in (x, y)]
    assert energy_distance(x, y).mean == pytest.approx(biased - sum(inner), rel=1e-9)


def test_equal_distributions_are_at_zero_and_others_are_not():
    same = [energy_distance(sample(50, 0, 3, i), sample(50, 0, 3, 100 + i)).mean for i in range(40)]
    assert abs(np.mean(same)) < 3 * np.std(same) / np.sqrt(40)
    found = energy_distance(sample(80, 0, 3), sample(80, 1, 3, 1))
    assert 0 < found.low < found.mean < found.high


def test_bounds_hold_the_true_distance():
    """Of N(0, 1) and N(1, 1): 2 E|N(1, 2)| - 2 E|N(0, 2)|."""
    scale = np.sqrt(2)
    true = 2 * stats.foldnorm.mean(1 / scale, scale=scale) - 2 * stats.foldnorm.mean(0, scale=scale)
    held = []
    for i in range(40):
        found = energy_distance(sample(60, 0, 1, i), sample(60, 1, 1, 100 + i), resamples=300)
        held.append(found.low <= true <= found.high)
    assert np.mean(held) > 0.8


def test_chance_is_even_where_nothing_differs():
    chances = [
        permutation_test(sample(20, 0, 2, i), sample(25, 0, 2, 100 + i), resamples=200)
        for i in range(60)
    ]
    assert stats.kstest(chances, "uniform").pvalue > 0.01
    assert permutation_test(sample(30), sample(30, 2, seed=1), resamples=500) == pytest.approx(
        1 / 500
    )


def test_chance_is_the_share_of_all_deals_that_are_as_far_apart():
    """All 462 ways to deal eleven rows to five and six, each distance summed by hand."""
    rows = np.concatenate([sample(5, 0, 2), sample(6, 0.9, 2, 1)])

    def apart(first):
        one, other = rows[list(first)], rows[[i for i in range(11) if i not in first]]
        across = np.mean([np.linalg.norm(a - b) for a in one for b in other])
        inner = [
            np.mean([np.linalg.norm(a - b) for a, b in itertools.permutations(part, 2)])
            for part in (one, other)
        ]
        return 2 * across - sum(inner)

    deals = [apart(first) for first in itertools.combinations(range(11), 5)]
    share = np.mean(np.array(deals) >= deals[0] - 1e-12)
    assert 0.02 < share < 0.5
    assert permutation_test(rows[:5], rows[5:], resamples=8000) == pytest.approx(share, abs=0.02)


def test_too_few_rows_have_no_distance():
    assert np.isnan(energy_distance(sample(1), sample(9)).mean)
    assert np.isnan(permutation_test(sample(9), sample(0)))
