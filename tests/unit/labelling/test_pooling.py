import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.unit.labelling.fakes import GRID, truth

from scenefw.core.errors import ConfigError, InputError
from scenefw.labelling.pooling import Reconstruction, Weights, disagreement, fit_weights, pool

EQUAL = Weights(1.0, 1.0, 1.0, 1.0, 1e-6, 1e-6)


def normal(values):
    return (values / values.sum(axis=0)).astype(np.float32)


POSITIVE = arrays(np.float64, (2, 3, 7), elements=st.floats(0.01, 1.0))


@given(POSITIVE, st.floats(0, 1))
def test_pool_is_the_weighted_product(values, well):
    views, of_map = normal(values[0]), normal(values[1])
    where = np.full(7, well, np.float32)
    weights = Weights(0.5, 2.0, 0.1, 1.5, 0.1, 0.2)
    a, b = 0.5 + 1.5 * well, 0.1 + 1.4 * well
    expected = normal((0.9 * views + 0.1 / 3) ** a * (0.8 * of_map + 0.2 / 3) ** b)
    np.testing.assert_allclose(pool(views, of_map, where, weights), expected, rtol=2e-4)


@given(POSITIVE)
def test_an_expert_that_knows_nothing_changes_nothing(values):
    views, uniform = normal(values[0]), np.full((3, 7), 1 / 3, np.float32)
    for pooled in (
        pool(views, uniform, np.ones(7), EQUAL),
        pool(uniform, views, np.ones(7), EQUAL),
    ):
        np.testing.assert_allclose(pooled, views, atol=1e-4)


def test_an_expert_that_says_never_can_be_outvoted():
    views = np.array([[1.0], [0.0]], np.float32)  # quite sure, and wrong
    of_map = np.array([[0.02], [0.98]], np.float32)
    doubting = Weights(1.0, 1.0, 1.0, 1.0, 0.2, 0.01)
    assert pool(views, of_map, np.ones(1), doubting).argmax(axis=0) == 1


def expert(rng, truth, right):
    """Probabilities whose argmax is the truth in a share of cases, 0.9 sure whatever it is."""
    said = np.where(rng.random(len(truth)) < right, truth, rng.integers(0, 3, len(truth)))
    return np.where(np.arange(3)[:, None] == said, 0.9, 0.05).astype(np.float32)


def test_calibration_finds_the_better_expert_of_each_place():
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 3, 6000)
    well = (np.arange(6000) % 2).astype(np.float32)
    poor_map, good_map, views = (expert(rng, truth, share) for share in (0.3, 0.95, 0.7))
    of_map = np.where(well > 0, good_map, poor_map)
    weights = fit_weights(views, of_map, well, truth)
    assert weights.map_well > weights.views_well > 0
    assert weights.map_poor < weights.views_poor
    correct = [np.mean(p.argmax(axis=0) == truth) for p in (views, of_map)]
    pooled = pool(views, of_map, well, weights)
    assert np.mean(pooled.argmax(axis=0) == truth) > max(correct) + 0.05
    # calibrated: it is right as often as it is sure
    assert pooled.max(axis=0).mean() == pytest.approx(
        np.mean(pooled.argmax(axis=0) == truth), abs=0.03
    )


def test_a_vertex_counts_to_the_class_that_it_was_drawn_for():
    rng = np.random.default_rng(1)
    truth = np.repeat([0, 1], [5000, 500])
    drawn_for = truth.copy()
    drawn_for[:500] = 1  # surface that views take for an object
    said = np.where(np.arange(len(truth)) < 500, 1, truth)
    views = np.where(np.arange(3)[:, None] == said, 0.9, 0.05).astype(np.float32)
    of_map = expert(rng, truth, 0.9)
    well = np.ones(len(truth), np.float32)
    by_truth = fit_weights(views, of_map, well, truth)
    assert by_truth == fit_weights(views, of_map, well, truth, truth)
    as_drawn = fit_weights(views, of_map, well, truth, drawn_for)

    def right_at_outlines(weights):
        pooled = pool(views, of_map, well, weights)
        return np.mean(pooled.argmax(axis=0)[:500] == truth[:500])

    assert right_at_outlines(by_truth) < 0.1
    assert right_at_outlines(as_drawn) > 0.9


def test_calibration_needs_vertices():
    nothing = np.zeros((3, 0), np.float32)
    with pytest.raises(InputError, match="no vertex"):
        fit_weights(nothing, nothing, np.zeros(0), np.zeros(0, np.int32))


def test_reconstruction_is_high_where_sure_low_where_not():
    whole = truth()
    measure = Reconstruction(confidence=1.0, deviation=0.002, window=5)
    assert measure.of(whole) == pytest.approx(np.full(GRID.shape, 0.5), abs=1e-6)
    object.__setattr__(whole, "confidence", np.full(GRID.shape, 99, np.float32))
    assert measure.of(whole).min() == pytest.approx(0.99, abs=1e-5)
    object.__setattr__(whole, "variance", np.full(GRID.shape, 4e-6, np.float32))
    assert measure.of(whole).max() == pytest.approx(0.495, abs=1e-5)
    whole.heights[:, 20:] = np.nan
    half = measure.of(whole)
    assert half[16, 30] == 0
    assert half[16, 5] == pytest.approx(0.495, abs=1e-5)
    assert half[16, 20] == pytest.approx(0.495 * 2 / 5, abs=1e-5)  # two of five columns are seen


def test_winners():
    views, of_map = np.array([[0.9, 0.4], [0.1, 0.6]]), np.array([[0.2, 0.3], [0.8, 0.7]])
    by_views, by_map = disagreement(views, of_map, of_map)
    assert by_views.tolist() == [False, True]
    assert by_map.all()


def test_settings_are_checked():
    for wrong in ({"views_well": -1.0}, {"map_doubt": 0.0}, {"views_doubt": 1.0}):
        with pytest.raises(ConfigError, match="expected"):
            Weights(**wrong)
    with pytest.raises(ConfigError, match="expected"):
        Reconstruction(confidence=0.0)
