"""Noise of floors: drawn heights, and real ones."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from scenefw.data.files.readers import read_frames
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.floor_noise import (
    FloorNoise,
    floor_sigma,
    has_correlated_noise,
)
from scenefw.perception.observation.points import world_points


def test_things_lower_than_others_are_no_noise_of_the_floor():
    """Flat things on half of the image, and their noise, are above it."""
    rng = np.random.default_rng(0)
    heights = 0.001 * rng.normal(size=(200, 200))
    heights[:120] += 0.02
    near, far = (np.full(heights.shape, z, np.float32) for z in (1.0, 2.0))
    assert floor_sigma(heights, near) == pytest.approx(0.001, rel=0.1)
    assert floor_sigma(heights, far) == pytest.approx(0.00025, rel=0.1)  # at 1 m
    assert floor_sigma(heights[:120], near[:120]) == 0  # no floor is seen
    assert floor_sigma(np.full((4, 4), np.nan), near[:4, :4]) == 0


def test_what_was_moved_onto_the_floor_says_nothing_about_its_noise():
    """Most of the image lies beyond the table, where depth is that of the floor."""
    rng = np.random.default_rng(0)
    heights = 0.002 * rng.normal(size=(200, 200))
    heights[:160] = 1e-8 * rng.normal(size=(160, 200))
    depth = np.ones(heights.shape, np.float32)
    assert floor_sigma(heights, depth) == pytest.approx(0.002, rel=0.1)


def heights_of(frame):
    """Heights (H, W) above the floor that is found in a frame."""
    pose = FloorFinder().find(frame).T_world_camera
    return world_points(replace(frame, camera=frame.camera.moved(pose)))[..., 2]


@pytest.mark.parametrize(
    ("group", "correlated"), [("realsense_table", True), ("mosd_learn", False)]
)
def test_noise_of_stereo_cameras_is_correlated_and_of_structured_light_is_not(
    real_data, group, correlated
):
    frames = list(read_frames(real_data / "real" / group))[:9]
    assert len(frames) == 9
    assert [has_correlated_noise(heights_of(one)) for one in frames] == [correlated] * 9


@pytest.mark.parametrize("factor", [1, 2])
def test_noise_is_correlated_where_neighbours_err_alike(factor):
    """Fields of one deviation, with and without ties between neighbours, in two sizes of image."""
    noise = np.random.default_rng(0).normal(size=(480 * factor, 640 * factor))
    waves = gaussian_filter(noise, 4 * factor)
    assert has_correlated_noise(0.003 * waves / waves.std())
    assert not has_correlated_noise(0.003 * noise)
    assert not has_correlated_noise(np.zeros_like(noise))
    assert not has_correlated_noise(np.full_like(noise, np.nan))


@pytest.mark.parametrize("factor", [1, 2])
def test_noise_of_an_image_grows_with_depth_squared(factor):
    """Heights that err by 2 mm at 1 m, and so by 8 mm at 2 m."""
    normal = np.random.default_rng(0).normal(size=(240 * factor, 320 * factor))
    depth = np.linspace(0.8, 1.2, normal.shape[0], dtype=np.float32)[:, None] + 0 * normal
    noise = FloorNoise.of(0.002 * normal * depth**2, depth.astype(np.float32))
    assert noise.sigma == pytest.approx(0.002, rel=0.05)
    assert not noise.is_correlated
    np.testing.assert_allclose(noise.at(np.float32([1.0, 2.0])), noise.sigma * np.array([1, 4]))


@pytest.mark.parametrize("distance", [0.7, 2.0])
def test_waves_reach_as_high_as_they_are_and_single_pixels_no_thing(distance):
    depth = np.full((2, 2), distance, np.float32)
    sigma = 0.002
    waves = FloorNoise(sigma, is_correlated=True).reach(depth)
    np.testing.assert_allclose(waves, 7 * sigma * distance**2, rtol=1e-6)
    single = FloorNoise(sigma, is_correlated=False).reach(depth)
    np.testing.assert_allclose(single, np.minimum(waves, 0.015), rtol=1e-6)
    assert not FloorNoise(0.0, is_correlated=False).reach(depth).any()
