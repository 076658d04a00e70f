"""Ramps of depth at edges: blurred images, against what rays really meet."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, uniform_filter1d
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw.core.types import GridSpec
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.observation.mixed_pixels import mixed_pixels, without_ramps
from scenefw.perception.observation.observation import JointGeometry, Observation
from scenefw.perception.observation.points import world_points
from scenefw.perception.steps import Objects

TOWER = Box((-0.06, -0.06, 0.0), (0.06, 0.06, 0.15))
SIZES = [(320, 240), (640, 480)]


def blurred_frame(size, blurred=True, noise=0.001):
    """The frame of a stereo camera, and by how much its depth is wrong."""
    camera = camera_at(eye=(0.0, -0.9, 0.6), size=size)
    sharp = frame_of(camera, (TOWER,))
    field = gaussian_filter(np.random.default_rng(0).normal(size=sharp.depth.shape), 4)
    depth = (sharp.depth + noise * field / field.std()).astype(np.float32)
    if blurred:
        window = 2 * round(7 * size[0] / 640) + 1
        depth = (1 / uniform_filter1d(1 / depth, window, axis=1)).astype(np.float32)
    return replace(sharp, depth=depth, camera=camera), np.abs(depth - sharp.depth)


def seen(size, blurred=True):
    """Points, what pixels show, by how much their depth is wrong, and the camera."""
    frame, wrong = blurred_frame(size, blurred)
    return world_points(frame), frame.labels, wrong, frame.camera


@pytest.mark.parametrize("size", SIZES)
def test_ramps_are_found_and_right_depth_is_kept(size):
    points, _, wrong, camera = seen(size)
    found = mixed_pixels(points, camera.T_world_camera[:3, 3])
    high = points[..., 2] > 0.02
    ramps = high & (wrong > 0.02)
    assert ramps.sum() > 0.001 * ramps.size
    assert found[ramps].mean() > 0.8
    assert found[wrong < 0.004].mean() < 0.01


@pytest.mark.parametrize("size", SIZES)
def test_a_jump_between_two_pixels_is_no_ramp(size):
    points, labels, _, camera = seen(size, blurred=False)
    found = mixed_pixels(points, camera.T_world_camera[:3, 3])
    assert found[labels == 1].mean() < 0.005


@pytest.mark.parametrize("depth", [0.06, 0.3])
@pytest.mark.parametrize("size", SIZES)
def test_a_side_along_which_the_camera_looks_is_a_surface(size, depth):
    """It is wide, or ends in a jump."""
    box = Box((-0.06, -depth / 2, 0.0), (0.06, depth / 2, 0.15))
    camera = camera_at(eye=(0.24, -0.9, 0.4), size=size)
    sharp = frame_of(camera, (box,))
    field = gaussian_filter(np.random.default_rng(0).normal(size=sharp.depth.shape), 4)
    waving = (sharp.depth + 0.0003 * field / field.std()).astype(np.float32)
    points = world_points(replace(sharp, depth=waving, camera=camera))
    side = (np.abs(points[..., 0] - 0.06) < 0.004) & (sharp.labels == 1)
    side &= np.abs(points[..., 2] - 0.08) < 0.05
    assert side.sum() > 100
    assert mixed_pixels(points, camera.T_world_camera[:3, 3])[side].mean() < 0.15


@pytest.mark.parametrize("size", SIZES)
def test_an_observation_of_a_stereo_camera_has_them(size):
    frame, _ = blurred_frame(size)
    view = Observation(frame)
    np.testing.assert_array_equal(view.mixed, mixed_pixels(view.points, view.eye))
    assert view.mixed.any()


def test_an_image_without_noise_has_none():
    frame, _ = blurred_frame(SIZES[0], noise=0.0)
    view = Observation(frame)
    assert mixed_pixels(view.points, view.eye).any()
    assert not view.mixed.any()


def test_a_camera_whose_pixels_err_by_themselves_has_none():
    frame, _ = blurred_frame(SIZES[0])
    noise = np.random.default_rng(0).normal(0, 0.003, frame.depth.shape)
    view = Observation(replace(frame, depth=(frame.depth + noise).astype(np.float32)))
    assert mixed_pixels(view.points, view.eye).any()
    assert not view.mixed.any()


def test_no_depth_is_not_mixed():
    points, _, _, camera = seen(SIZES[0])
    points[:40] = np.nan
    assert not mixed_pixels(points, camera.T_world_camera[:3, 3])[:40].any()


@pytest.mark.parametrize("size", SIZES)
def test_ramps_make_no_object_longer(size):
    """An object with its ramps reaches far behind the true one; its evidence doesn't."""
    points, labels, wrong, camera = seen(size)
    eye = camera.T_world_camera[:3, 3]
    grid = GridSpec(resolution=32)
    own = ((labels == 1) | (wrong > 0.004)) & (points[..., 2] > 0.02)
    objects = Objects(own.astype(np.int32))
    geometry = JointGeometry(points, grid, np.zeros(grid.shape, dtype=bool), eye)
    end = TOWER.upper[1] + 0.01
    evidence = EvidenceGathering()
    with_ramps = evidence.of(1, objects, geometry).points
    clean = replace(geometry, mixed=mixed_pixels(points, eye))
    without = evidence.of(1, objects, clean).points
    assert (with_ramps[:, 1] > end).mean() > 0.01
    assert (without[:, 1] > end).mean() < 0.3 * (with_ramps[:, 1] > end).mean()


def test_parts_that_are_ramps_are_none():
    """But not parts of which the larger part is steep: that may be an object's side."""
    parts = np.array([[0, 1, 1, 1, 1, 1, 2, 2, 2, 2, 3]], np.int32)
    mixed = np.array([[1, 1, 1, 1, 0, 0, 1, 1, 1, 0, 0]], bool)
    np.testing.assert_array_equal(without_ramps(parts, mixed), [[0, 1, 1, 1, 1, 1, 0, 0, 0, 0, 3]])
    np.testing.assert_array_equal(without_ramps(0 * parts, mixed), 0 * parts)
