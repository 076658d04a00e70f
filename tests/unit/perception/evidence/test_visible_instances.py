"""Which object of a volume pixels show, against what their rays really meet."""

import numpy as np
import pytest
from tests.unit.perception.evidence.test_gathering import scene_of
from tests.unit.perception.synthetic import STACK

from scenefw.perception.evidence.visible_instances import visible_instances


def shown_of(objects, geometry, among, **settings):
    return visible_instances(objects.instances, geometry.points, geometry.grid, among, **settings)


@pytest.mark.parametrize("resolution", [32, 64])
def test_pixels_show_the_box_that_their_rays_meet(resolution):
    objects, geometry = scene_of(resolution)
    above = geometry.points[..., 2] > 1e-4
    shown = shown_of(objects, geometry, above)
    seam = geometry.points[..., 2] < STACK[0].upper[2] + geometry.grid.voxel_size
    sure = (objects.masks > 0) & above & ~((objects.masks == 2) & seam)
    np.testing.assert_array_equal(shown[sure], objects.masks[sure])
    assert (shown == objects.masks)[objects.masks > 0].mean() > 0.98
    assert not shown[~above].any()


def test_points_far_outside_of_all_objects_show_none():
    """The floor close to a box is within reach, and further away it isn't."""
    objects, geometry = scene_of(64)
    everywhere = np.ones(objects.masks.shape, dtype=bool)
    ratios = []
    for reach in (1.0, 2.0, 4.0):
        shown = shown_of(objects, geometry, everywhere, reach=reach)
        x, y, _ = np.abs(np.moveaxis(geometry.points, -1, 0))
        away = np.maximum(x - 0.10, y - 0.08)  # from the sides of the lower box
        floor = objects.masks == 0
        assert not shown[floor & (away > (reach + 1) * geometry.grid.voxel_size)].any()
        ratios.append((shown[floor] > 0).mean())
    assert 0 < ratios[0] < ratios[1] < ratios[2]


def test_pixels_without_depth_or_outside_of_the_grid_show_none():
    objects, geometry = scene_of(32)
    everywhere = np.ones(objects.masks.shape, dtype=bool)
    points = geometry.points.copy()
    rows, columns = np.nonzero(objects.masks)
    points[rows[::2], columns[::2]] = np.nan
    points[rows[1::2], columns[1::2]] += 9.0
    shown = visible_instances(objects.instances, points, geometry.grid, everywhere)
    assert not shown[objects.masks > 0].any()


def test_numbers_of_instances_may_have_gaps():
    objects, geometry = scene_of(32)
    everywhere = np.ones(objects.masks.shape, dtype=bool)
    usual = shown_of(objects, geometry, everywhere)
    names = np.array([0, 9, 4], np.int32)
    found = visible_instances(names[objects.instances], geometry.points, geometry.grid, everywhere)
    np.testing.assert_array_equal(found, names[usual])
