from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plugins.tracking.tests.moving_boxes import CROWD, camera, image
from tests.unit.perception.pipelines import pipeline_of

from scenefw.core.types import GridSpec
from scenefw.data.files.readers import read_frames
from scenefw.noise.frames import disturb
from scenefw.noise.kinect import Kinect
from scenefw.noise.stereo import Stereo
from scenefw.noise.time_of_flight import TimeOfFlight
from scenefw_tracking.depth_memory import DepthMemory, depth_sigma

SIGMA = 0.002


def depths(width=96):
    """A slope with an edge of 20 cm in the middle, and a hole."""
    depth = np.linspace(0.8, 1.2, width * 72, dtype=np.float32).reshape(72, width)
    depth[:, width // 2 :] += np.float32(0.2)
    depth[10:20, 10:20] = 0
    return depth


def noisy(depth, seed, sigma=SIGMA):
    noise = np.random.default_rng(seed).normal(0, sigma, depth.shape) * depth**2
    return (depth + noise).astype(np.float32)


@given(seed=st.integers(1, 10**6))
def test_noise_is_no_change(seed):
    memory = DepthMemory.of(noisy(depths(), seed), SIGMA)
    again = noisy(depths(), seed + 1)
    assert not memory.nearer(again).any()
    assert not memory.farther(again).any()
    assert memory.matches(again)[depths() > 0].mean() > 0.999


@given(shift=st.sampled_from([-0.05, 0.05]), row=st.integers(24, 60), column=st.integers(4, 40))
def test_a_patch_that_changes_is_found_and_nothing_else(shift, row, column):
    memory = DepthMemory.of(noisy(depths(), 0), SIGMA)
    later = noisy(depths(), 1)
    later[row : row + 6, column : column + 6] += np.float32(shift)
    changed, other = memory.nearer(later), memory.farther(later)
    if shift > 0:
        changed, other = other, changed
    inside = np.zeros(later.shape, bool)
    inside[row : row + 6, column : column + 6] = True
    assert changed[inside].mean() > 0.9
    assert not changed[~inside].any()
    assert not other.any()


def test_edges_may_move_by_a_pixel_and_holes_say_nothing():
    depth = depths()
    memory = DepthMemory.of(depth, SIGMA)
    moved = depth.copy()
    middle = depth.shape[1] // 2
    moved[:, middle] = depth[:, middle - 1]
    moved[30:40, 5:15] = 0
    moved[10:20, 10:20] = 1.0
    assert not memory.nearer(moved).any()
    assert not memory.farther(moved).any()
    moved[:, middle : middle + 4] = depth[:, middle - 1 : middle]
    assert memory.nearer(moved)[:, middle + 1].all()


@pytest.mark.parametrize("width", [320, 640])
@pytest.mark.parametrize("sigma", [0.0005, 0.002])
def test_the_floor_says_how_noisy_depth_is(width, sigma):
    """Along the camera's axis, whatever the angle at which it sees the floor."""
    view = pipeline_of(grid=GridSpec(16)).observe(image(CROWD, 0, camera(width), sigma))
    assert depth_sigma(view) == pytest.approx(sigma, rel=0.1)


@pytest.mark.parametrize(
    ("sensor", "width"), [(Kinect(), 320), (Stereo(), 320), (Stereo(), 640), (TimeOfFlight(), 640)]
)
def test_noise_of_sensors_is_no_change(sensor, width):
    """Also where they blur edges and lose pixels, others in each image; how much is drawn, too."""
    seen_by = camera(width)
    true = replace(image(CROWD, 0, seen_by, 0), camera=seen_by)
    images = [disturb(true, {"sensor": sensor}, 0, 0, number) for number in range(3)]
    observe = pipeline_of(grid=GridSpec(16)).observe
    sigma = max(depth_sigma(observe(each)) for each in images)
    memory = DepthMemory.of(images[0].depth, sigma)
    for later in images[1:]:  # waves of a stereo camera hardly ever add up to a change
        assert memory.nearer(later.depth).mean() < 2e-4
        assert memory.farther(later.depth).mean() < 2e-4


@pytest.mark.parametrize("group", ["realsense_table", "mosd_learn"])
def test_real_images_with_other_noise_are_unchanged(real_data, group):
    frames = list(read_frames(real_data / "real" / group))[:2]
    assert frames
    for frame in frames:
        sigma = depth_sigma(pipeline_of(grid=GridSpec(16)).observe(frame))
        assert 0.0003 < sigma < 0.01
        memory = DepthMemory.of(frame.depth, sigma)
        again = np.round(noisy(frame.depth, 1, sigma), 3)
        assert not memory.nearer(again).any()
        assert not memory.farther(again).any()
