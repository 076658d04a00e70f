import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from scenefw.core.errors import InputError
from scenefw.metrics.occupancy import (
    binary_cross_entropy,
    coverage,
    expected_occupancy,
    occupancy_iou,
    probable_occupancy,
)


@given(
    arrays.arrays(np.float64, 9, elements=st.sampled_from([0.0, 1 / 3, 2 / 3, 1.0, 1e-30])),
    arrays.arrays(np.bool_, 9),
)
def test_cross_entropy_equals_torch(probability, truth):
    expected = torch.nn.functional.binary_cross_entropy(
        torch.tensor(probability), torch.tensor(truth, dtype=torch.float64)
    )
    assert binary_cross_entropy(probability, truth) == pytest.approx(float(expected), rel=1e-6)


def test_a_wrong_voxel_costs_100_and_a_right_one_nothing():
    assert binary_cross_entropy(np.array([0.0, 1.0]), np.array([True, True])) == 50.0


def test_expected_occupancy_averages_hard_decisions():
    samples = np.array([[-0.1, 0.1, 0.0], [-1e-9, -0.1, 0.2]])
    np.testing.assert_array_equal(expected_occupancy(samples), [1.0, 0.5, 0.0])


def test_probable_occupancy_is_logistic():
    samples = np.array([[-0.02, 0.0, 0.05]])
    expected = [1 / (1 + math.exp(d / 0.01)) for d in (-0.02, 0.0, 0.05)]
    np.testing.assert_allclose(probable_occupancy(samples, 0.01), expected)
    assert probable_occupancy(np.array([[1e3, -1e3]]), 1e-3).tolist() == [0.0, 1.0]


def test_overlap_of_occupied_voxels():
    a, b = np.array([1, 1, 0, 0], bool), np.array([0, 1, 1, 0], bool)
    assert occupancy_iou(a, b) == pytest.approx(1 / 3)
    assert occupancy_iou(~(a | ~a), ~(a | ~a)) == 1.0


@pytest.mark.parametrize("samples", [2, 3, 7])
def test_exchangeable_samples_cover_as_often_as_promised(samples):
    rng = np.random.default_rng(samples)
    values = rng.normal(size=(samples + 1, 20, 20, 20))
    found = coverage(values[:-1], values[-1], np.ones((20, 20, 20), bool))
    assert found == pytest.approx((samples - 1) / (samples + 1), abs=0.03)


def test_coverage_counts_chosen_voxels_alone():
    samples, truth = np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([0.5, 2.0])
    assert coverage(samples, truth, np.array([True, False])) == 1.0
    assert coverage(samples, truth, np.array([False, True])) == 0.0
    assert math.isnan(coverage(samples, truth, np.array([False, False])))


def test_bad_shapes_are_named():
    with pytest.raises(InputError, match="shape"):
        binary_cross_entropy(np.zeros(3), np.zeros(4, bool))
