"""What a depth image says, against rays and the volumes that it was fused into."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.perception.blurred import seen
from tests.unit.perception.grouping.test_merging import free
from tests.unit.perception.observations import observation_of
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw.core.batches import PartialTSDF
from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.mapping.projective import Projective
from scenefw.perception.observation.observation import Observation

CAMERA = camera_at(eye=(0.0, -0.85, 0.6))
FRAME = replace(frame_of(CAMERA), camera=CAMERA)
GRID = GridSpec(resolution=32)


@pytest.mark.parametrize("size", [(160, 120), (320, 240)])
def test_points_lie_on_what_rays_meet(size):
    camera = camera_at(eye=(0.2, -0.85, 0.6), size=size)
    frame = replace(frame_of(camera), camera=camera)
    frame.depth[:9] = 0
    view = Observation(frame)
    assert np.isnan(view.points[:9]).all()
    assert np.isnan(view.heights[:9]).all()
    floor = (frame.labels == 0) & (frame.depth > 0)
    assert np.abs(view.heights[floor]).max() < 1e-5
    for label, box in enumerate(STACK, start=1):
        points = view.points[(frame.labels == label) & (frame.depth > 0)]
        assert (points > np.array(box.lower) - 1e-5).all()
        assert (points < np.array(box.upper) + 1e-5).all()
    np.testing.assert_allclose(view.eye, (0.2, -0.85, 0.6), atol=1e-12)


@pytest.mark.parametrize("resolution", [32, 64])
def test_what_is_free_lies_in_front_of_what_its_pixel_shows(resolution):
    """By more than a voxel; what is clear has free neighbours."""
    view = observation_of(FRAME, GridSpec(resolution=resolution))
    expected = free(view.grid, CAMERA, FRAME)
    assert (view.free == expected).mean() > 0.99
    assert (view.free & expected).sum() > 0.98 * expected.sum()
    neighbours = np.ones(view.grid.shape, dtype=bool)
    padded = np.pad(view.free, 1)
    for axis in range(3):
        for shift in (-1, 1):
            neighbours &= np.roll(padded, shift, axis)[1:-1, 1:-1, 1:-1]
    np.testing.assert_array_equal(view.clear, view.free & neighbours)
    assert 0 < view.clear.sum() < view.free.sum()


def test_a_batch_of_one_brings_its_image():
    view = observation_of(FRAME, GRID)
    again = Observation.of_partial(view.partial, GRID)
    assert again.partial is view.partial
    assert again.masks is None
    np.testing.assert_array_equal(again.depth, FRAME.depth)
    np.testing.assert_allclose(again.points, view.points, atol=1e-5)  # its camera is of float32
    np.testing.assert_array_equal(again.free, view.free)


def test_what_was_left_out_is_told():
    volume = torch.ones(1, 1, *GRID.shape)
    bare = Observation.of_partial(PartialTSDF(volume, volume > 0), GRID)
    assert not bare.free[volume[0, 0].numpy() <= GRID.voxel_size].any()
    for name in ("frame", "depth", "points", "noise", "mixed"):
        with pytest.raises(InputError, match="depth images"):
            getattr(bare, name)
    for name, words in (("partial", "was not fused"), ("free", "was not fused"), ("grid", "grid")):
        with pytest.raises(InputError, match=words):
            getattr(Observation(FRAME), name)


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_a_restored_view_has_the_noise_that_was_measured(size):
    """Its own depth would say that no stereo camera took it."""
    sharp, blurred, _ = seen(size, reach=6)
    view = observation_of(blurred, GRID, masks=sharp.labels)
    exact = view.restored(sharp.depth, Projective())
    assert view.noise.is_correlated
    assert exact.noise == view.noise
    assert exact.noise != Observation(exact.frame).noise
    assert exact.masks is sharp.labels
    assert exact.camera is view.camera
    np.testing.assert_array_equal(exact.depth, sharp.depth)
    fused = observation_of(replace(blurred, depth=sharp.depth), GRID)
    assert torch.equal(exact.partial.distance, fused.partial.distance)
    np.testing.assert_array_equal(exact.free, fused.free)
    assert (exact.free != view.free).any()
