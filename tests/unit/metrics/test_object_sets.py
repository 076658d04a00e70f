"""Distances between sets of objects against permutations, and the energy score's propriety."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scenefw.core.errors import InputError
from scenefw.metrics.object_sets import LabelSets, energy_score, set_distance

labels = arrays(np.int32, 24, elements=st.integers(0, 3))


def brute(a, b):
    """The distance, tried over all assignments of masks."""
    first, second = ([one == i for i in np.unique(one[one > 0])] for one in (a, b))
    if len(first) < len(second):
        first, second = second, first
    if not first:
        return 0.0
    none = np.zeros(a.shape, bool)
    second = second + [none] * (len(first) - len(second))

    def apart(x, y):
        union = (x | y).sum()
        return 1 - (x & y).sum() / union if y.any() else 1.0

    sums = [sum(apart(x, second[j]) for x, j in zip(first, order, strict=True))
            for order in permutations(range(len(first)))]  # fmt: skip
    return min(sums) / len(first)


@given(labels, labels)
def test_as_tried_over_all_assignments(a, b):
    assert LabelSets([a, b]).distance(0, 1) == pytest.approx(brute(a, b))


@given(labels, labels, labels)
def test_it_is_a_metric(a, b, c):
    sets = LabelSets([a, b, c])
    found = sets.distances([0, 1, 2])
    assert np.allclose(found, found.T)
    assert (np.diag(found) == 0).all()
    assert found[0, 2] <= found[0, 1] + found[1, 2] + 1e-9
    assert LabelSets([a, (a * 7) % 11]).distance(0, 1) == pytest.approx(0.0)  # numbering is free


def test_empty_sets():
    nothing, something = np.zeros(5, int), np.array([0, 1, 1, 2, 0])
    assert LabelSets([nothing, nothing]).distance(0, 1) == 0.0
    assert LabelSets([nothing, something]).distance(0, 1) == 1.0
    assert set_distance(np.zeros((0, 3))) == 1.0
    with pytest.raises(InputError, match="same voxels"):
        LabelSets([nothing, np.zeros(4, int)])


def test_one_sample_or_equal_ones_score_their_distance():
    assert energy_score(np.array([0.3]), np.zeros((1, 1))) == pytest.approx(0.3)
    assert energy_score(np.full(4, 0.3), np.zeros((4, 4))) == pytest.approx(0.3)


def test_honest_samples_score_best_and_unbiased():
    """Scenes are A or B with even odds, 0.8 apart: showing both beats A, B or the truth's rival."""
    rng = np.random.default_rng(0)
    truths = rng.integers(0, 2, 4000)
    honest = rng.integers(0, 2, (4000, 3))

    def mean_score(samples):
        rows = [
            (0.8 * (s != t), 0.8 * (s[:, None] != s)) for s, t in zip(samples, truths, strict=True)
        ]
        return np.mean([energy_score(to, among) for to, among in rows])

    assert mean_score(honest) == pytest.approx(0.4 - 0.2, abs=0.01)
    assert mean_score(np.zeros((4000, 3), int)) == pytest.approx(0.4, abs=0.02)
