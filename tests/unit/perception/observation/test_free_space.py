"""Places in superquadrics, and which of them a view shows to be free."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.completion.test_support import box
from tests.unit.perception.evidence.test_gathering import view_of

from scenefw.fitting.placed import in_frame_of, shape_of
from scenefw.perception.observation.free_space import places_in, seen_through, surely_free


def free_right_of(x, resolution):
    """A view that shows all places with a larger x to be free."""
    view = view_of(resolution)
    return replace(view, free=view.grid.centres()[..., 0] > x)


def test_places_lie_in_the_object_and_reach_its_faces():
    one = box((-0.1, 0.0, 0.05), (0.1, 0.06, 0.12))
    places = places_in(one)
    assert (shape_of(one).value(in_frame_of(one, places)) < 1.001).all()
    assert np.allclose(places.min(axis=0), (-0.1, 0.0, 0.05), atol=2e-3)
    assert np.allclose(places.max(axis=0), (0.1, 0.06, 0.12), atol=2e-3)


@pytest.mark.parametrize("resolution", [32, 64])
def test_the_share_that_is_seen_through_is_that_of_its_places(resolution):
    """Counted by hand: places right of a plane between two voxels."""
    view = free_right_of(0.0, resolution)
    edge = view.grid.centres()[..., 0]
    plane = (edge[edge > 0].min() + edge[edge <= 0].max()) / 2
    for shift in (-0.2, -0.047, 0.013, 0.053, 0.2):
        places = places_in(box((shift - 0.1, 0.0, 0.0), (shift + 0.1, 0.1, 0.1)))
        assert seen_through(places, view) == pytest.approx((places[:, 0] > plane).mean(), abs=0.01)


def test_outside_the_grid_nothing_is_seen():
    view = free_right_of(-9.0, 32)
    assert seen_through(places_in(box((5.0, 5.0, 5.0), (5.1, 5.1, 5.1))), view) == 0.0


@pytest.mark.parametrize("resolution", [32, 64])
def test_what_is_surely_free_is_a_voxel_away_from_the_rest(resolution):
    view = free_right_of(0.0, resolution)
    sure = surely_free(view).free
    inner = (slice(1, -1),) * 3
    beyond = view.grid.centres()[..., 0] - view.grid.voxel_size > 0
    np.testing.assert_array_equal(sure[inner], beyond[inner])
