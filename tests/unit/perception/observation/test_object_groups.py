"""Groups of objects, from points of what stands on a table."""

import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw.perception.observation.object_groups import fitting_groups, object_groups

SIDE = 0.9


def square(rng, count, low, high):
    return rng.uniform([*low, 0.02], [*high, 0.1], (count, 3))


def groups_of(*parts):
    points = np.concatenate(parts)
    labels, groups = object_groups(points, np.ones(len(points)), SIDE)
    return labels, groups


@pytest.mark.parametrize("behind", [1.6, 2.2])
def test_a_slope_from_an_object_to_what_is_far_behind_is_left_out(behind):
    rng = np.random.default_rng(0)
    thing = square(rng, 5000, (-0.1, -0.1), (0.1, 0.1))
    slope = square(rng, 200, (-0.02, 0.1), (0.02, behind))
    _, groups = groups_of(thing, slope)
    centre, (group,) = fitting_groups(groups, SIDE, "it")
    assert np.ptp(group.cells, axis=0).max() <= SIDE
    assert (group.cells.min(axis=0) < -0.08).all()
    assert abs(centre[0]) < 0.02
    assert -0.1 < centre[1] < SIDE / 2


def test_what_is_wide_is_refused():
    rng = np.random.default_rng(0)
    board = square(rng, 9000, (-0.6, -0.1), (0.6, 0.1))
    _, groups = groups_of(board)
    with pytest.raises(InputError, match="without a gap"):
        fitting_groups(groups, SIDE, "it")


def test_a_group_that_fits_keeps_all_its_cells():
    rng = np.random.default_rng(0)
    thing = square(rng, 5000, (-0.1, -0.1), (0.1, 0.1))
    beside = square(rng, 100, (0.1, -0.02), (0.6, 0.02))
    labels, (group,) = groups_of(thing, beside)
    assert len(group.cells) == (labels > 0).sum()
    assert np.ptp(group.cells[:, 0]) > 0.6
