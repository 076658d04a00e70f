"""Pairs of regions that `python -m benchmarks.fit_merging` fits to, of images made by hand."""

import numpy as np
import pytest
from benchmarks.fit_merging import Samples, compared_samples

SIDE = 12
REGIONS = np.repeat(np.arange(1, 5), SIDE)[None].repeat(SIDE, axis=0).astype(np.int32)
"""Four squares in a row."""
ONE_PART = np.ones_like(REGIONS)


def compared(labels, border_odds, regions=REGIONS):
    """Samples of an image in whose row of regions each border has its own log odds."""
    across = np.full((SIDE, regions.shape[1] - 1), 9.0)
    for number, odds in enumerate(border_odds, start=1):
        across[:, SIDE * number - 1] = odds
    down = np.full((SIDE - 1, regions.shape[1]), 9.0)
    image = ((regions, across, down, ONE_PART), np.asarray(labels, np.int32), 7)
    return compared_samples([image], 0.0, np.array([1.0, 0.0, 0.0]))


def test_each_pair_that_comes_up_is_a_sample_with_the_true_answer():
    two_objects = np.where(REGIONS <= 2, 1, 2)
    samples = compared(two_objects, (2.0, -1.0, 3.0))
    assert samples.is_same.tolist() == [True, True, False]  # 3 + 4, then 1 + 2, then the two
    assert samples.measures[:, 0] == pytest.approx([3, 2, -1])
    assert samples.measures[:, 1].tolist() == [1, 1, 1]
    assert np.exp(samples.measures[:, 2]) == pytest.approx([SIDE**2, SIDE**2, 2 * SIDE**2])
    assert samples.scenes.tolist() == [7, 7, 7]


def test_what_was_told_apart_comes_up_again_after_a_neighbour_has_joined():
    labels = np.where(REGIONS == 1, 1, 2)
    samples = compared(labels, (4.0, 1.0, 0.5))  # 1 and 2 first, and after 2 + 3, and with 4
    assert samples.is_same.tolist() == [False, True, False, True, False]


@pytest.mark.parametrize("unclear", [-1, 0])
def test_regions_without_an_object_are_no_samples(unclear):
    labels = np.where(REGIONS <= 2, 1, unclear)  # unknown, or none
    samples = compared(labels, (2.0, -3.0, -3.0))
    assert samples.is_same.tolist() == [True]


def test_regions_of_two_objects_are_no_samples():
    labels = np.full(REGIONS.shape, 1)
    labels[:, SIDE + SIDE // 2 :] = 2  # through the middle of region 2
    samples = compared(labels, (2.0, 1.0, 3.0))  # 1 joins 2 as the network says, untold
    assert samples.measures[:, 0] == pytest.approx([3, 1])
    assert samples.is_same.tolist() == [True, False]


def test_labels_of_the_whole_image_are_thinned_as_the_regions_are():
    labels = np.where(REGIONS <= 2, 1, 2).repeat(2, axis=0).repeat(2, axis=1)
    assert compared(labels, (2.0, -1.0, 3.0)).is_same.tolist() == [True, True, False]


def test_errors_are_counted_in_scenes_that_were_held_out():
    random = np.random.default_rng(0)
    is_same = random.random(400) < 0.5
    noise = random.normal(size=400)
    measures = np.stack([4.0 * is_same + noise, noise, random.normal(size=400)], axis=1)
    samples = Samples(measures, is_same, np.arange(400) % 10)
    both, first = samples.wrong_ratio(slice(3)), samples.wrong_ratio(slice(1))
    assert both == 0  # the second is the noise of the first
    assert first == pytest.approx(0.0228, abs=0.015)  # normal distributions 2 sigma from between
