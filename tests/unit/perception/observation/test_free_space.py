"""Places in superquadrics, and which of them a view shows to be free."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.completion.test_support import box
from tests.unit.perception.evidence.test_gathering import scene_of

from scenefw.fitting.placed import SHELLS, in_frame_of, shape_of
from scenefw.perception.observation.free_space import free_ratio, places_in


def free_right_of(x, resolution):
    """The geometry of a view that shows all places with a larger x to be free."""
    _, geometry = scene_of(resolution)
    return replace(geometry, free=geometry.grid.centres()[..., 0] > x)


def test_places_lie_in_the_object_and_nearly_reach_its_faces():
    one = box((-0.1, 0.0, 0.05), (0.1, 0.06, 0.12))
    places = places_in(one)
    assert (shape_of(one).value(in_frame_of(one, places)) < 1).all()
    reach = np.ptp(places, axis=0) / (0.2, 0.06, 0.07)
    np.testing.assert_allclose(reach, SHELLS[0], atol=0.02)
    np.testing.assert_allclose(places.mean(axis=0), (0.0, 0.03, 0.085), atol=2e-3)


@pytest.mark.parametrize("resolution", [32, 64])
def test_the_ratio_of_free_places_is_counted(resolution):
    """Counted by hand: places right of a plane between two voxels."""
    geometry = free_right_of(0.0, resolution)
    edge = geometry.grid.centres()[..., 0]
    plane = (edge[edge > 0].min() + edge[edge <= 0].max()) / 2
    for shift in (-0.2, -0.047, 0.013, 0.053, 0.2):
        places = places_in(box((shift - 0.1, 0.0, 0.0), (shift + 0.1, 0.1, 0.1)))
        found = free_ratio(places, geometry.free, geometry.grid)
        assert found == pytest.approx((places[:, 0] > plane).mean(), abs=0.01)


def test_outside_the_grid_nothing_is_free():
    geometry = free_right_of(-9.0, 32)
    places = places_in(box((5.0, 5.0, 5.0), (5.1, 5.1, 5.1)))
    assert geometry.free.all()
    assert free_ratio(places, geometry.free, geometry.grid) == 0.0
    inside = places_in(box((-0.1, -0.1, 0.0), (0.1, 0.1, 0.1)))
    both = np.concatenate([places, inside])
    assert free_ratio(both, geometry.free, geometry.grid) == 1.0


@pytest.mark.parametrize("resolution", [32, 64])
def test_what_is_clear_is_a_voxel_away_from_the_rest(resolution):
    geometry = free_right_of(0.0, resolution)
    inner = (slice(1, -1),) * 3
    beyond = geometry.grid.centres()[..., 0] - geometry.grid.voxel_size > 0
    np.testing.assert_array_equal(geometry.clear[inner], beyond[inner])
