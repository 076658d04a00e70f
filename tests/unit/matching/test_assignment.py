import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from scenefw.core.errors import InputError
from scenefw.matching.assignment import Assignment

costs = arrays.arrays(
    np.float64, st.tuples(st.integers(1, 4), st.integers(1, 4)), elements=st.floats(-5, 5)
)


def least_total(cost):
    if cost.shape[0] > cost.shape[1]:
        cost = cost.T
    rows = range(cost.shape[0])
    choices = itertools.permutations(range(cost.shape[1]), cost.shape[0])
    return min(sum(cost[r, c] for r, c in zip(rows, chosen, strict=True)) for chosen in choices)


@given(costs)
def test_total_is_the_least_of_all_pairings(cost):
    pairs = Assignment().assign(cost)
    assert len(pairs) == min(cost.shape)
    assert len(set(pairs[:, 0])) == len(set(pairs[:, 1])) == len(pairs)
    assert cost[pairs[:, 0], pairs[:, 1]].sum() == pytest.approx(least_total(cost), abs=1e-9)


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (0, 0)])
def test_nothing_to_match_gives_no_pairs(shape):
    assert Assignment().assign(np.zeros(shape)).shape == (0, 2)


@pytest.mark.parametrize("cost", [np.zeros(3), np.array([[np.nan]])])
def test_bad_costs_are_named(cost):
    with pytest.raises(InputError, match="cost"):
        Assignment().assign(cost)
