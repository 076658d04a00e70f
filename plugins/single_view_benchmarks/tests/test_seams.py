"""Seams of instances: masks whose answer is known."""

import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw_single_view_benchmarks.seams import Seams, seam_scores, seams

SHAPE = (60, 80)  # a diagonal of 100 pixels: tolerance 0.03 is 3 pixels
TOLERANCE = 0.03


def two(cut, gap=0, rows=slice(10, 50), left=10, right=70):
    """Two rectangles side by side, cut at a column."""
    labels = np.zeros(SHAPE, np.int32)
    labels[rows, left:cut] = 1
    labels[rows, cut + gap : right] = 2
    return labels


def score(predicted, true):
    return seam_scores(predicted, true, TOLERANCE)


def test_a_seam_is_a_line_on_each_side_of_the_cut():
    found = seams(two(40), 3)
    assert found[10:50, 39:41].all()
    # at either end the outline, too, is within 3 pixels of the other object
    assert found[11:49].sum() == 2 * 38
    assert not found[:, :36].any()
    assert not found[:, 44:].any()


def test_the_truth_scores_1_whatever_the_labels_are_called():
    true = two(40)
    result = score(3 - true + 4 * (true > 0) - 3 * (true == 0), true)
    assert (result.seam_precision, result.seam_recall, result.seam_f) == (1, 1, 1)
    assert result.predicted == result.true == seams(true, 3).sum()


def test_one_mask_for_both_finds_no_seam():
    result = score((two(40) > 0).astype(int), two(40))
    assert (result.seam_precision, result.seam_recall, result.seam_f) == (1, 0, 0)
    assert score(np.zeros(SHAPE, int), two(40)).seam_f == 0


def test_a_cut_too_many_costs_precision_alone():
    true = two(40)
    predicted = true.copy()
    predicted[10:50, 55:70] = 3
    result = score(predicted, true)
    assert result.seam_recall == 1
    assert result.seam_precision == pytest.approx(0.5, abs=0.01)


def test_a_cut_counts_within_the_tolerance_only():
    assert score(two(43), two(40)).seam_f == 1  # both lines are 3 pixels off
    assert 0.45 < score(two(44), two(40)).seam_f < 0.65  # one line of the two
    assert score(two(50), two(40)).seam_f == 0


def test_the_margin_of_the_floor_changes_nothing():
    """Masks that are smaller all round, as when more counts as floor: borders move, seams stay."""
    true = two(40)
    shrunk = two(40, rows=slice(16, 44), left=16, right=64)
    result = score(shrunk, true)
    assert result.seam_precision == 1
    assert result.seam_recall == pytest.approx(28 / 40, abs=0.1)  # as much as the masks show
    grown = two(40, rows=slice(6, 54), left=6, right=74)
    assert score(grown, true).seam_recall == 1


def test_objects_apart_have_no_seam():
    assert seams(two(40, gap=2), 3).any()  # 3 pixels from one to the other
    assert not seams(two(40, gap=3), 3).any()
    result = score(two(40, gap=9), two(40, gap=9))
    assert (result.predicted, result.true, result.seam_f) == (0, 0, 1)


def test_the_edge_of_the_image_is_no_border():
    labels = np.ones(SHAPE, int)
    assert not seams(labels, 3).any()


def test_what_is_unknown_counts_for_nothing():
    true = np.zeros(SHAPE, int)
    true[10:50, 10:40] = 1
    true[10:50, 40:70] = -1
    result = score(two(55), true)
    assert (result.predicted, result.true) == (0, 0)


def test_seams_add_up_over_images():
    total = Seams(1, 2, 3, 4) + Seams(1, 2, 3, 4)
    assert total == Seams(2, 4, 6, 8)
    assert total.seam_f == pytest.approx(2 * 0.5 * 0.75 / 1.25)


def test_images_of_two_sizes_are_refused():
    with pytest.raises(InputError, match="one size"):
        seam_scores(np.zeros((3, 3), int), np.zeros((4, 4), int))
