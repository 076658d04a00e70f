"""Scores of counted forecasts against sums over events, and calibration against brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import InputError
from scenefw.metrics.forecasts import (
    Outcomes,
    brier_score,
    calibration_error,
    count_score,
    log_odds_classes,
    log_score,
)


def events(seed, count=500, classes=7):
    rng = np.random.default_rng(seed)
    label = rng.integers(0, classes, count)
    probability = rng.uniform(0.05, 0.95, classes)
    came = rng.random(count) < probability[label]
    return label, probability, came


def test_scores_are_means_over_events():
    label, probability, came = events(0)
    outcomes = Outcomes.of(label, probability[label], came, 7)
    given_to_truth = np.where(came, probability[label], 1 - probability[label])
    assert log_score(outcomes, probability) == pytest.approx(-np.log(given_to_truth).mean())
    squares = (probability[label] - came) ** 2
    assert brier_score(outcomes, probability) == pytest.approx(squares.mean())
    gaps = [abs((probability[c] - came[label == c]).sum()) for c in range(7)]
    assert calibration_error(outcomes) == pytest.approx(sum(gaps) / 500)


def test_adding_outcomes_is_counting_all_events():
    label, probability, came = events(1)
    whole = Outcomes.of(label, probability[label], came, 7)
    parts = [Outcomes.of(label[s], probability[label[s]], came[s], 7)
             for s in (slice(0, 100), slice(100, None))]  # fmt: skip
    assert np.allclose((parts[0] + parts[1]).true, whole.true)
    assert np.allclose((parts[0] + parts[1]).forecast, whole.forecast)


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), min_size=1, max_size=6))
def test_calibrated_probabilities_rise_and_are_the_best_of_all_that_rise(counts):
    total = np.array([a + b for a, b in counts], float)
    outcomes = Outcomes(total, np.array([a for a, _ in counts], float), total / 2)
    found = outcomes.calibrated()
    assert (np.diff(found) >= -1e-12).all()
    assert ((found > 0) & (found < 1)).all()
    frequency, weight = outcomes.frequencies(), total + 1.0
    best = _brute_isotonic(frequency, weight)
    assert np.allclose(found, best, atol=1e-9)


def _brute_isotonic(values, weights):
    """Min-max formula of isotonic regression (Barlow et al. 1972)."""

    def mean(i, j):
        return np.average(values[i : j + 1], weights=weights[i : j + 1])

    n = len(values)
    return [max(min(mean(i, j) for j in range(k, n)) for i in range(k + 1)) for k in range(n)]


def test_a_calibrated_forecast_does_not_cost_more_than_its_base_rate():
    label, probability, came = events(2, count=4000)
    outcomes = Outcomes.of(label, probability[label], came, 7)
    rate = np.full(7, outcomes.true.sum() / outcomes.total.sum())
    assert log_score(outcomes, np.sort(outcomes.frequencies())) > 0
    order = np.argsort(probability)
    ranks = np.argsort(order)
    ranked = Outcomes.of(ranks[label], probability[label], came, 7)
    assert log_score(ranked, ranked.calibrated()) < log_score(outcomes, rate)


def test_classes_of_log_odds():
    edges = np.array([-1.0, 0.0, 1.0])
    odds = np.array([-2.0, -0.5, 0.5, 2.0])
    assert log_odds_classes(1 / (1 + np.exp(-odds)), edges).tolist() == [0, 1, 2, 3]
    assert log_odds_classes(np.array([0.0, 1.0]), edges).tolist() == [0, 3]


def test_other_numbers_of_probabilities_are_refused():
    label, probability, came = events(3)
    with pytest.raises(InputError, match="classes"):
        log_score(Outcomes.of(label, probability[label], came, 7), probability[:3])


@given(st.lists(st.integers(0, 5), min_size=1, max_size=12), st.integers(0, 5))
def test_the_score_of_a_number_is_the_squared_gap_of_distributions(drawn, true):
    """The integral of (F(x) - 1[x >= true])^2, without what draws share with themselves."""
    values = np.arange(0, 6)
    share = np.array([(np.array(drawn) <= x).mean() for x in values])
    expected = ((share - (values >= true)) ** 2)[:-1].sum()
    count = len(drawn)
    if count > 1:
        expected -= (share * (1 - share)).sum() / (count - 1)
    assert count_score(np.array(drawn, float), true) == pytest.approx(expected, abs=1e-12)


def test_few_draws_of_the_truth_score_as_many_do():
    random = np.random.default_rng(0)
    means = []
    for count in (2, 5, 50):
        drawn = random.poisson(0.7, (4000, count)).astype(float)
        true = random.poisson(0.7, 4000)
        means.append(np.mean([count_score(d, t) for d, t in zip(drawn, true, strict=True)]))
    assert means == pytest.approx([means[2]] * 3, rel=0.06)
