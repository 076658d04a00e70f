import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from scenefw.core.errors import InputError
from scenefw.matching.costs import iou_matrix, overlaps

labellings = arrays.arrays(np.int32, (5, 6), elements=st.sampled_from([0, 1, 2, 3, 40, 1000]))


def brute_force(predicted, true):
    rows, columns = np.unique(predicted[predicted > 0]), np.unique(true[true > 0])
    return np.array(
        [
            [
                np.sum((predicted == i) & (true == j)) / np.sum((predicted == i) | (true == j))
                for j in columns
            ]
            for i in rows
        ]
    ).reshape(len(rows), len(columns))


@given(labellings, labellings)
def test_equals_brute_force_and_is_symmetric(predicted, true):
    found = iou_matrix(predicted, true)
    np.testing.assert_allclose(found, brute_force(predicted, true))
    np.testing.assert_allclose(found.T, iou_matrix(true, predicted))


@given(labellings, labellings)
def test_counts_add_up(predicted, true):
    found = overlaps(predicted, true)
    assert found.shared.sum() == np.sum((predicted > 0) & (true > 0))
    assert found.predicted_sizes.sum() == np.sum(predicted > 0)
    assert found.true_sizes.sum() == np.sum(true > 0)
    assert found.predicted.tolist() == np.unique(predicted[predicted > 0]).tolist()


@given(labellings, st.permutations([1, 2, 3, 40]))
def test_numbers_do_not_matter(labels, order):
    table = np.zeros(1001, np.int32)
    table[[1, 2, 3, 40, 1000]] = [*order, 1000]
    values = iou_matrix(table[labels], labels)
    np.testing.assert_allclose(values.max(axis=0, initial=0), np.ones(values.shape[1]))


def test_bad_input_is_named():
    with pytest.raises(InputError, match="shape"):
        iou_matrix(np.zeros((2, 2), int), np.zeros((2, 3), int))
    with pytest.raises(InputError, match=">= 0"):
        iou_matrix(np.full((2, 2), -1), np.zeros((2, 2), int))
