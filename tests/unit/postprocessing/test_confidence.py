import json

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.special import expit

from scenefw.core.errors import ConfigError
from scenefw.perception.estimate.shape_cues import CUES
from scenefw.postprocessing.confidence import ExpectedOverlap, agreements

labellings = arrays.arrays(np.int32, (4, 4, 4), elements=st.integers(0, 4))


def brute_force(instances, samples):
    found = {}
    for i in np.unique(instances[instances > 0]):
        overlaps = []
        for sample in samples:
            ious = [
                np.sum((instances == i) & (sample == j)) / np.sum((instances == i) | (sample == j))
                for j in np.unique(sample[sample > 0])
            ]
            overlaps.append(max(ious, default=0.0))
        found[int(i)] = float(np.mean(overlaps))
    return found


@given(labellings, st.lists(labellings, min_size=1, max_size=3))
def test_equals_brute_force(instances, samples):
    found = agreements(torch.from_numpy(instances), [torch.from_numpy(s) for s in samples])
    expected = brute_force(instances, samples)
    assert found.keys() == expected.keys()
    for label, value in expected.items():
        assert found[label] == pytest.approx(value)


@given(labellings)
def test_the_same_objects_under_other_numbers_are_certain(instances):
    renumbered = np.array([0, 7, 3, 9, 1])[instances]
    found = agreements(torch.from_numpy(instances), [torch.from_numpy(renumbered)])
    assert all(value == 1.0 for value in found.values())


def test_an_object_in_half_of_the_samples_is_half_certain():
    one = torch.zeros(4, 4, 4, dtype=torch.int32)
    one[:2] = 1
    assert agreements(one, [one, torch.zeros_like(one)]) == {1: 0.5}


def test_without_samples_all_is_certain():
    assert agreements(torch.tensor([[[0, 2, 5]]]), []) == {2: 1.0, 5: 1.0}


def fitted_to(signs, weights, seed=0, count=4000):
    random = np.random.default_rng(seed)
    numbers = random.normal(0, 1, (count, len(weights)))
    truth = expit(numbers @ weights + 0.5)
    return ExpectedOverlap.fitted(signs, numbers, truth)


def test_a_fit_finds_the_weights_that_made_the_truth():
    weights = np.array([1.0, -0.5, 0.0])
    fit = fitted_to({"a": 1, "b": -1, "c": 0}, weights)
    assert fit.weights / fit.scale == pytest.approx(weights, abs=0.02)
    asked = np.random.default_rng(1).normal(0, 1, (50, 3))
    assert fit(asked) == pytest.approx(expit(asked @ weights + 0.5), abs=0.01)


@given(
    arrays.arrays(np.float64, (30, 3), elements=st.floats(-10, 10)),
    arrays.arrays(np.float64, 30, elements=st.floats(0, 1)),
    st.floats(0, 5),
)
def test_expected_iou_changes_with_each_number_as_its_sign_says(numbers, truth, step):
    fit = ExpectedOverlap.fitted({"a": 1, "b": -1, "c": 0}, numbers, truth)
    before = fit(numbers)
    assert ((before >= 0) & (before <= 1)).all()
    assert (fit(numbers + [step, 0, 0]) >= before - 1e-12).all()
    assert (fit(numbers + [0, step, 0]) <= before + 1e-12).all()


def test_a_fit_is_right_on_average():
    random = np.random.default_rng(0)
    numbers, truth = random.normal(0, 1, (300, 2)), random.uniform(0, 1, 300)
    expected = ExpectedOverlap.fitted({"a": 0, "b": 1}, numbers, truth)(numbers)
    assert expected.mean() == pytest.approx(truth.mean(), abs=1e-3)


def test_a_calibration_is_the_same_after_json():
    fit = fitted_to({"a": 1, "b": -1}, np.array([0.3, -0.2]), count=50)
    again = ExpectedOverlap.of(json.loads(json.dumps(fit.content)))
    asked = np.random.default_rng(2).normal(0, 1, (5, 2))
    assert again.names == fit.names
    np.testing.assert_array_equal(again(asked), fit(asked))


def test_the_shipped_calibration_knows_all_cues_and_their_signs():
    shipped = ExpectedOverlap.shipped("set_extents")
    assert shipped.names == tuple(CUES)
    for weight, sign in zip(shipped.weights, CUES.values(), strict=True):
        assert weight * sign >= 0


@pytest.mark.parametrize(
    "content",
    [
        {}, {"numbers": {}}, {"numbers": {"a": {"centre": 0.0}}, "intercept": 0.0},
        {"numbers": {"a": {"centre": 0.0, "scale": 0.0, "weight": 1.0}}, "intercept": 0.0},
        {"numbers": {"a": {"centre": 0.0, "scale": 1.0, "weight": 1.0}}, "intercept": float("nan")},
    ],
)  # fmt: skip
def test_calibrations_that_mean_nothing_are_refused(content):
    with pytest.raises(ConfigError, match="calibration"):
        ExpectedOverlap.of(content)
