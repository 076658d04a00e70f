"""Holes of masks, beside hole filling by scipy."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from scenefw.perception.whole_masks import without_holes


def disc(size=60):
    v, u = np.mgrid[:size, :size] - size // 2
    return (np.hypot(u, v) < size // 3).astype(np.int32), np.hypot(u, v) < size // 6


def test_holes_without_depth_or_below_the_floor_are_the_objects():
    masks, hole = disc()
    for inside in (np.nan, -0.1):
        found = without_holes(np.where(hole, 0, masks), np.where(hole, inside, 0.05 * masks))
        np.testing.assert_array_equal(found, masks)


def test_a_hole_through_which_the_floor_is_seen_stays():
    masks, hole = disc()
    open_ = np.where(hole, 0, masks)
    np.testing.assert_array_equal(without_holes(open_, 0.05 * open_), open_)


def test_what_lies_between_two_objects_or_at_the_end_of_the_image_stays():
    masks, hole = disc()
    halves = np.where(hole, 0, masks * (1 + (np.arange(60) >= 30)))
    heights = np.where(hole, np.nan, 0.05)
    np.testing.assert_array_equal(without_holes(halves, heights), halves)
    cut = np.where(hole, 0, masks)[:, 30:]  # the hole is open to one side
    np.testing.assert_array_equal(without_holes(cut, heights[:, 30:]), cut)


@given(st.integers(0, 1000))
@settings(max_examples=25, deadline=None)
def test_a_single_object_is_filled_as_scipy_fills_it(seed):
    """Where all that is no object has no depth."""
    random = np.random.default_rng(seed)
    masks = (ndimage.gaussian_filter(random.normal(size=(40, 50)), 2) > 0).astype(np.int32)
    heights = np.where(masks > 0, 0.05, np.nan)
    expected = ndimage.binary_fill_holes(masks)
    np.testing.assert_array_equal(without_holes(3 * masks, heights) > 0, expected)


def test_nothing_to_fill():
    none = np.zeros((5, 6), np.int32)
    assert not without_holes(none, np.full((5, 6), np.nan)).any()
    full = none + 2
    np.testing.assert_array_equal(without_holes(full, np.full((5, 6), np.nan)), full)
