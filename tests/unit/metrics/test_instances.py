import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from scenefw.metrics.instances import instance_scores, object_ious

labellings = arrays.arrays(np.int32, (4, 5), elements=st.integers(0, 3))


def brute_force(predicted, true):
    """Best mean IoU over all one-to-one pairings, and panoptic quality, by definition."""
    rows, columns = np.unique(predicted[predicted > 0]), np.unique(true[true > 0])
    iou = {
        (i, j): np.sum((predicted == i) & (true == j)) / np.sum((predicted == i) | (true == j))
        for i in rows
        for j in columns
    }
    padded = [*rows, *[None] * len(columns)]
    best = max(
        sum(iou.get(pair, 0.0) for pair in zip(chosen, columns, strict=True))
        for chosen in itertools.permutations(padded, len(columns))
    )
    found = [value for value in iou.values() if value > 0.5]
    misses = len(rows) + len(columns) - 2 * len(found)
    total = len(found) + misses / 2
    return (
        best / len(columns) if len(columns) else 1.0,
        sum(found) / total if total else 1.0,
        len(rows) - len(columns),
    )


@given(labellings, labellings)
def test_equals_brute_force(predicted, true):
    found = instance_scores(predicted, true)
    iou, quality, excess = brute_force(predicted, true)
    assert found.iou == pytest.approx(iou)
    assert found.panoptic_quality == pytest.approx(quality)
    assert found.excess == excess
    assert found.count_error == abs(excess)


@given(labellings, labellings, st.permutations([1, 2, 3]))
def test_numbers_do_not_matter(predicted, true, order):
    renumbered = np.array([0, *order])[predicted]
    assert instance_scores(renumbered, true) == pytest.approx(instance_scores(predicted, true))


@given(labellings)
def test_truth_is_perfect(labels):
    found = instance_scores(labels, labels)
    assert (found.iou, found.panoptic_quality, found.recall, found.count_error) == (1, 1, 1, 0)


def test_one_instance_for_two_objects():
    true = np.array([1] * 6 + [2] * 4)
    found = instance_scores(np.ones(10, int), true)
    assert found.iou == pytest.approx(0.3)
    assert found.panoptic_quality == pytest.approx(0.6 / 1.5)
    assert found.recall == 0.5
    assert found.excess == -1


@given(labellings, labellings)
def test_ious_of_single_objects_add_up(predicted, true):
    found = object_ious(predicted, true)
    assert list(found) == np.unique(true[true > 0]).tolist()
    if found:
        scores = instance_scores(predicted, true)
        assert np.mean(list(found.values())) == pytest.approx(scores.iou)
        assert np.mean([iou > 0.5 for iou in found.values()]) == pytest.approx(scores.recall)


def test_an_object_without_a_partner_has_no_iou():
    true = np.array([[7, 7, 0, 2]])
    assert object_ious(np.array([[1, 1, 0, 0]]), true) == {2: 0.0, 7: 1.0}
