import numpy as np
import pytest
import torch
from torchmetrics.classification import MulticlassJaccardIndex

from scenefw.core.errors import InputError
from scenefw.evaluation.semantic_scores import class_ious, count_classes, mean_iou, weighted_iou


def labels(seed, low=0):
    return np.random.default_rng(seed).integers(low, 4, (40, 30))


def test_ious_are_those_of_torchmetrics():
    predicted, true = labels(0), labels(1)
    counts = count_classes(predicted, true, 4)
    for average, ours in (("none", class_ious), ("macro", mean_iou), ("weighted", weighted_iou)):
        reference = MulticlassJaccardIndex(4, average=average)
        expected = reference(torch.from_numpy(predicted), torch.from_numpy(true)).numpy()
        np.testing.assert_allclose(ours(counts), expected, rtol=1e-5)


def test_what_has_no_label_is_missed_and_what_has_no_truth_does_not_count():
    true = np.array([0, 0, 0, 0, 1, 1, -1, -1])
    predicted = np.array([0, 0, 0, -1, 1, 0, 0, 1])
    np.testing.assert_allclose(class_ious(count_classes(predicted, true, 2)), [3 / 5, 1 / 2])


def test_a_class_that_is_not_there_does_not_count():
    true = np.array([0, 0, 0, 1])
    counts = count_classes(np.array([0, 0, 2, 1]), true, 3)
    assert np.isnan(class_ious(counts)[2])
    assert mean_iou(counts) == pytest.approx((2 / 3 + 1) / 2)
    assert weighted_iou(counts) == pytest.approx(3 / 4 * 2 / 3 + 1 / 4)


def test_only_where_asked():
    predicted, true = labels(0, -1), labels(1, -1)
    where = labels(2) > 1
    np.testing.assert_array_equal(
        count_classes(predicted, true, 4, where), count_classes(predicted[where], true[where], 4)
    )


def test_counts_add_up():
    parts = [count_classes(labels(i), labels(i + 5), 4) for i in range(3)]
    whole = count_classes(
        np.stack([labels(i) for i in range(3)]), np.stack([labels(i + 5) for i in range(3)]), 4
    )
    np.testing.assert_array_equal(sum(parts), whole)


def test_wrong_input():
    with pytest.raises(InputError, match="shape"):
        count_classes(np.zeros(3, int), np.zeros(4, int), 2)
    with pytest.raises(InputError, match="class id 5"):
        count_classes(np.full(3, 5), np.zeros(3, int), 2)
    assert np.isnan(mean_iou(count_classes(np.zeros(2, int), np.full(2, -1), 2)))
    assert np.isnan(weighted_iou(count_classes(np.zeros(2, int), np.full(2, -1), 2)))
