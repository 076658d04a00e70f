from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.unit.labelling.fakes import GRID, truth

from scenefw.core.errors import ConfigError
from scenefw.labelling.pooling import UNCALIBRATED, Pool, Weights, disagreement, pool
from scenefw.labelling.reconstruction import Reconstruction

EQUAL = Pool(Weights(1.0, 1.0, 1.0, 1.0), Weights(1.0, 1.0, 1.0, 1.0), doubt=1e-6)


def normal(values):
    return (values / values.sum(axis=0)).astype(np.float32)


def says_anything(probabilities, nothing):
    """Whether a distribution (C, ...) is another one than that of knowing nothing."""
    away = np.abs(probabilities - nothing).max(axis=0)
    assume(not ((away > 1e-7) & (away < 1e-5)).any())  # rounding decides between these
    return away > 1e-6


POSITIVE = arrays(np.float64, (2, 3, 7), elements=st.floats(0.01, 1.0))


@given(POSITIVE, st.floats(0, 1))
def test_pool_is_the_weighted_product(values, well):
    views, of_map = normal(values[0]), normal(values[1])
    where = np.full(7, well, np.float32)
    weights = Weights(0.5, 2.0, 0.1, 1.5, -1.0, 2.0)
    a, b, bias = 0.5 + 1.5 * well, 0.1 + 1.4 * well, -1.0 + 3.0 * well
    product = (0.9 * views + 0.1 / 3) ** a * (0.9 * of_map + 0.1 / 3) ** b
    told = says_anything(views, 1 / 3) | says_anything(of_map, 1 / 3)
    product[0] *= np.where(told, np.exp(bias), 1)
    uniform = np.full(3, 1 / 3, np.float32)
    found = pool(views, of_map, where, weights, 0.1, uniform)
    np.testing.assert_allclose(found, normal(product), rtol=5e-4)


def nested_by_hand(views, of_map, well, given, told):
    """Surface or object, then which object, of one vertex of four classes."""

    def product(v, m, nothing, weights):
        a = weights.views_poor + (weights.views_well - weights.views_poor) * well
        b = weights.map_poor + (weights.map_well - weights.map_poor) * well
        bias = weights.bias_poor + (weights.bias_well - weights.bias_poor) * well
        v, m = (
            [(1 - given.doubt) * x / u + given.doubt for x, u in zip(p, nothing, strict=True)]
            for p in (v, m)
        )
        powers = [u * x**a * y**b for x, y, u in zip(v, m, nothing, strict=True)]
        powers[0] *= np.exp(bias) if told else 1
        return [x / sum(powers) for x in powers]

    surface, of_object = product(
        [views[0], 1 - views[0]], [of_map[0], 1 - of_map[0]], [1 / 4, 3 / 4], given.surface
    )
    kinds = product(
        [x / sum(views[1:]) for x in views[1:]],
        [x / sum(of_map[1:]) for x in of_map[1:]],
        [1 / 3] * 3,
        given.objects,
    )
    return [surface, *(of_object * x for x in kinds)]


@given(arrays(np.float64, (2, 4, 3), elements=st.floats(0.01, 1.0)), st.floats(0, 1))
def test_surface_or_object_is_asked_before_which_object(values, well):
    views, of_map = normal(values[0]), normal(values[1])
    weights = Pool(Weights(0.3, 0.1, 0.4, 1.5, -0.5, 0.5), Weights(1.2, 0.2, 0.7, 0.6), doubt=0.02)
    found = weights(views, of_map, np.full(3, well, np.float32))
    told = says_anything(views[:1], 1 / 4) | says_anything(of_map[:1], 1 / 4)
    expected = [
        nested_by_hand(*(p[:, i].astype(float) for p in (views, of_map)), well, weights, told[i])
        for i in range(3)
    ]
    np.testing.assert_allclose(found, np.array(expected).T, rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(found.sum(axis=0), 1, rtol=1e-5)


@given(POSITIVE)
def test_an_expert_that_knows_nothing_changes_nothing(values):
    views, uniform = normal(values[0]), np.full((3, 7), 1 / 3, np.float32)
    for pooled in (EQUAL(views, uniform, np.ones(7)), EQUAL(uniform, views, np.ones(7))):
        np.testing.assert_allclose(pooled, views, atol=1e-4)


def test_what_neither_knows_stays_unknown():
    uniform = np.full((4, 5), 0.25, np.float32)
    biased = Pool(Weights(1.0, 1.0, 0.0, 1.0, bias_poor=3.0, bias_well=-3.0))
    np.testing.assert_allclose(biased(uniform, uniform, np.linspace(0, 1, 5)), 0.25, atol=1e-6)


def test_classes_that_are_quite_impossible_are_no_trouble():
    sure = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]], np.float32)
    pooled = EQUAL(sure, sure, np.ones(2))
    assert pooled.argmax(axis=0).tolist() == [0, 1]
    assert np.isfinite(pooled).all()


def test_an_expert_that_says_never_can_be_outvoted():
    views = np.array([[1.0], [0.0]], np.float32)  # quite sure, and wrong
    of_map = np.array([[0.02], [0.98]], np.float32)
    for doubt, winner in ((0.1, 1), (1e-6, 0)):
        doubting = Pool(Weights(1.0, 1.0, 0.0, map_well=1.5), doubt=doubt)
        assert doubting(views, of_map, np.ones(1)).argmax(axis=0) == winner


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
    for wrong in ({"views_well": -1.0}, {"map_well": np.nan}, {"bias_well": np.inf}):
        with pytest.raises(ConfigError, match="expected"):
            replace(UNCALIBRATED, **wrong)
    for doubt in (0.0, 1.0, np.nan):
        with pytest.raises(ConfigError, match="doubt"):
            Pool(doubt=doubt)
    with pytest.raises(ConfigError, match="expected"):
        Reconstruction(confidence=0.0)
