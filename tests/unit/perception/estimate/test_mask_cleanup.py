"""Gaps of masks, beside hole filling by scipy and the true pixels of boxes."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw.core.types import TriangleMesh
from scenefw.perception.estimate.mask_cleanup import (
    with_unmeasured_pixels,
    without_holes,
)
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.segmentation.colour_edges import colour_gradient


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
def test_a_single_object_is_filled_as_scipy_fills_it(seed):
    """Where all that is no object has no depth."""
    random = np.random.default_rng(seed)
    masks = (ndimage.gaussian_filter(random.normal(size=(40, 50)), 2) > 0).astype(np.int32)
    heights = np.where(masks > 0, 0.05, np.nan)
    expected = ndimage.binary_fill_holes(masks)
    np.testing.assert_array_equal(without_holes(3 * masks, heights), 3 * expected)


def test_each_hole_goes_to_the_object_around_it():
    masks, hole = disc()
    both = np.concatenate([2 * masks, 7 * masks], axis=1)
    holes = np.concatenate([hole, hole], axis=1)
    heights = np.where(holes, np.nan, np.where(both > 0, 0.05, 0.0))
    np.testing.assert_array_equal(without_holes(np.where(holes, 0, both), heights), both)


@pytest.mark.parametrize(("floor", "filled"), [(1, True), (4, False)])
def test_a_hole_is_enclosed_by_most_of_its_border(floor, filled):
    """A hole of 20 pixels of border, some of which meet the floor."""
    masks = np.full((30, 30), 5, np.int32)
    heights = np.full((30, 30), 0.05)
    masks[10:15, 10:15], heights[10:15, 10:15] = 0, np.nan
    masks[9, 10 : 10 + floor], heights[9, 10 : 10 + floor] = 0, 0.0
    assert (without_holes(masks, heights)[12, 12] == 5) == filled


def test_nothing_to_fill():
    none = np.zeros((5, 6), np.int32)
    assert not without_holes(none, np.full((5, 6), np.nan)).any()
    full = none + 2
    np.testing.assert_array_equal(without_holes(full, np.full((5, 6), np.nan)), full)


def painted_stack(size):
    """Camera, true ids, gradient of colour of boxes and table, and the boxes' estimates."""
    camera = camera_at(size=size)
    ids = frame_of(camera).labels
    colour = np.array([[120, 120, 120], [200, 40, 30], [30, 60, 190]], dtype=np.uint8)[ids]
    bodies = {
        k: trimesh.creation.box(bounds=[b.lower, b.upper]) for k, b in enumerate(STACK, start=1)
    }
    meshes = {k: TriangleMesh(body.vertices, body.faces) for k, body in bodies.items()}
    return camera, ids, colour_gradient(colour), estimate_objects(meshes, {})


@pytest.mark.parametrize("size", [(320, 240)])
@given(st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_pixels_without_depth_are_of_the_object_of_their_colour(size, seed):
    camera, ids, gradient, objects = painted_stack(size)
    noise = np.random.default_rng(seed).normal(size=ids.shape)
    smooth = ndimage.gaussian_filter(noise, size[0] / 40)
    unmeasured = smooth > np.quantile(smooth, 0.6)
    masks = np.where(unmeasured, 0, ids)
    filled = with_unmeasured_pixels(masks, unmeasured, gradient, objects, camera)
    np.testing.assert_array_equal(filled[~unmeasured], ids[~unmeasured])
    wrong = (filled != ids) & unmeasured
    assert wrong.sum() < 0.1 * (ids[unmeasured] > 0).sum()


def test_no_object_grows_beyond_its_box_in_the_image():
    """All is of one colour and nothing beside the boxes is measured."""
    camera, ids, gradient, objects = painted_stack((320, 240))
    gradient[:] = 0
    filled = with_unmeasured_pixels(ids, ids == 0, gradient, objects, camera)
    box = ndimage.find_objects((ids > 0).astype(int))[0]
    assert (filled[box] > 0).sum() > (ids[box] > 0).sum()
    filled[box] = 0
    assert not filled.any()


def test_an_object_behind_the_camera_gains_nothing():
    camera, ids, gradient, objects = painted_stack((320, 240))
    turned = camera.moved(camera.T_world_camera @ np.diag([-1.0, 1, -1, 1]))
    filled = with_unmeasured_pixels(ids, ids == 0, gradient, objects, turned)
    np.testing.assert_array_equal(filled, ids)
