import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torchmetrics.functional.classification import (
    multiclass_confusion_matrix,
    multiclass_jaccard_index,
)

from scenefw.core.errors import InputError
from scenefw.metrics.semantic import class_ious, count_classes, mean_iou, weighted_iou


@given(st.integers(0, 2**32 - 1), st.integers(2, 6))
def test_as_torchmetrics_counts(seed, classes):
    rng = np.random.default_rng(seed)
    predicted, true = rng.integers(0, classes, 50), rng.integers(-1, classes, 50)
    true[:classes] = np.arange(classes)  # where a class is missing, conventions differ
    counts = count_classes(predicted, true, classes)
    a, b = torch.from_numpy(predicted), torch.from_numpy(true)
    theirs = multiclass_confusion_matrix(a, b, classes, ignore_index=-1)
    np.testing.assert_array_equal(counts[:, :classes], theirs)
    assert not counts[:, classes].any()
    for average, ours in (("macro", mean_iou), ("weighted", weighted_iou)):
        index = multiclass_jaccard_index(a, b, classes, average=average, ignore_index=-1)
        assert ours(counts) == pytest.approx(float(index), abs=1e-5)


def test_no_label_is_a_miss():
    counts = count_classes(np.array([0, -1, 1, 1]), np.array([0, 0, 1, -1]), 2)
    np.testing.assert_array_equal(counts, [[1, 0, 1], [0, 1, 0]])
    np.testing.assert_allclose(class_ious(counts), [0.5, 1.0])


def test_counts_add_up_over_images():
    rng = np.random.default_rng(0)
    predicted, true = rng.integers(0, 3, (2, 4, 10, 10))
    whole = count_classes(predicted, true, 3)
    parts = sum(count_classes(p, t, 3) for p, t in zip(predicted, true, strict=True))
    np.testing.assert_array_equal(whole, parts)
    half = np.arange(10) < 5
    where = np.broadcast_to(half, true.shape)
    np.testing.assert_array_equal(
        count_classes(predicted, true, 3, where),
        count_classes(predicted[..., :5], true[..., :5], 3),
    )


def test_a_class_that_is_nowhere_does_not_count():
    counts = count_classes(np.array([0, 1]), np.array([0, 0]), 3)
    assert np.isnan(class_ious(counts)[1:]).all()
    assert mean_iou(counts) == 0.5
    nothing = count_classes(np.array([0]), np.array([-1]), 2)
    assert np.isnan([mean_iou(nothing), weighted_iou(nothing)]).all()


def test_wrong_input_is_refused():
    with pytest.raises(InputError, match="one grid"):
        count_classes(np.zeros(2, int), np.zeros(3, int), 2)
    with pytest.raises(InputError, match="class id 2"):
        count_classes(np.array([2]), np.array([0]), 2)
