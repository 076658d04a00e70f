"""Noise of time-of-flight cameras and of phones."""

import pytest
import torch
from tests.unit.kernels import analytic

from scenefw.core.errors import ConfigError
from scenefw.kernels.cameras import stack_cameras
from scenefw.noise.phone_lidar import PhoneLidar
from scenefw.noise.time_of_flight import TimeOfFlight

SIZE = (60, 80)


def applied(noise, depth, first=0):
    count = len(depth)
    seeds = torch.arange(first, first + count)
    return noise.apply(depth, stack_cameras([analytic.camera()] * count), seeds)


def step(count):
    depth = torch.full((count, *SIZE), 1.5)
    depth[:, :, 40:] = 1.0
    return depth


@pytest.mark.parametrize("noise", [TimeOfFlight(), PhoneLidar()])
def test_missing_stays_missing_and_the_rest_is_positive_or_lost(noise):
    depth = step(6)
    depth[:, 10:20, 5:30] = 0
    depth[0, 0, 0] = float("nan")
    noisy = applied(noise, depth)
    assert (noisy[:, 10:20, 5:30] == 0).all()
    assert torch.isfinite(noisy).all()
    assert (noisy >= 0).all()
    assert (noisy > 0).float().mean() > 0.7


@pytest.mark.parametrize("noise", [TimeOfFlight(), PhoneLidar()])
def test_an_image_depends_on_its_seed_alone(noise):
    depth = step(5)
    alone = torch.cat([applied(noise, depth[i : i + 1], i) for i in range(5)])
    torch.testing.assert_close(applied(noise, depth), alone, rtol=0, atol=1e-6)
    assert not torch.equal(applied(noise, depth), applied(noise, depth, 9))


@pytest.mark.parametrize("kind", [TimeOfFlight, PhoneLidar])
def test_what_is_out_of_reach_has_no_depth_and_mixes_with_nothing(kind):
    depth = step(6)
    depth[:, :, :20] = 9.0
    noisy = applied(kind(farthest=4.0), depth)
    assert (noisy[:, :, :15] == 0).all()
    assert noisy.max() < 2
    assert (noisy[:, :, 30:] > 0).float().mean() > 0.9


@pytest.mark.parametrize("kind", [TimeOfFlight, PhoneLidar])
def test_share_of_the_images_passes(kind):
    depth = step(200)
    noisy = applied(kind(share=0.3), depth)
    same = (noisy == depth).flatten(1).all(dim=1).float().mean().item()
    assert same == pytest.approx(0.7, abs=0.1)


def test_pixels_fly_between_two_surfaces_at_an_edge_only():
    noise = TimeOfFlight(deviation=0, multipath=0, lost=0)
    depth = step(40)
    noisy = applied(noise, depth)
    between = (noisy > 1.01) & (noisy < 1.49)
    assert between[:, :, 39:41].float().mean() > 0.2
    assert not between[:, :, :38].any()
    assert not between[:, :, 42:].any()
    assert (noisy[noisy > 0] >= 1 - 1e-5).all()
    assert (noisy <= 1.5 + 1e-5).all()


def test_deviation_grows_with_the_square_of_the_depth():
    noise = TimeOfFlight(multipath=0, lost=0, dark=1.0)
    spreads = [
        (applied(noise, torch.full((60, *SIZE), z)) - z).square().mean().sqrt().item()
        for z in (0.7, 1.4)
    ]
    assert spreads[1] / spreads[0] == pytest.approx(4, rel=0.05)
    assert spreads[0] < 0.003 * 0.7**2


def test_dark_patches_seem_farther():
    noise = TimeOfFlight(deviation=0, lost=0, multipath=0.01)
    error = applied(noise, torch.ones(40, *SIZE)) - 1
    assert error.min() >= 0
    assert 0.001 < error.mean() < 0.01


def test_lost_pixels_are_at_most_their_share():
    noisy = applied(TimeOfFlight(lost=0.05), torch.ones(60, *SIZE))
    lost = (noisy == 0).float().mean(dim=(1, 2))
    assert lost.max() <= 0.051
    assert lost.max() > 0.01


def test_phones_turn_edges_into_slopes_and_keep_planes():
    noise = PhoneLidar(deviation=0)
    depth = step(20)
    noisy = applied(noise, depth)
    slope = (noisy > 1.02) & (noisy < 1.48)
    assert slope[:, :, 34:46].any(dim=2).float().mean() > 0.5
    torch.testing.assert_close(noisy[:, :, :28], depth[:, :, :28])
    torch.testing.assert_close(noisy[:, :, 52:], depth[:, :, 52:])


def test_error_of_phones_is_smooth_and_no_larger_than_stated():
    error = applied(PhoneLidar(deviation=0.01), torch.ones(60, *SIZE)) - 1
    assert error.abs().max() <= 0.01 * 12**0.5 / 2 + 1e-6
    steps = (error[:, :, 1:] - error[:, :, :-1]).square().mean().sqrt()
    assert steps < 0.1 * error.square().mean().sqrt()


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        (TimeOfFlight, {"flying": 1.5}),
        (TimeOfFlight, {"deviation": -1}),
        (TimeOfFlight, {"jump": 0}),
        (PhoneLidar, {"spacing": 0}),
        (PhoneLidar, {"share": 2}),
    ],
)
def test_amounts_out_of_range_are_told(kind, settings):
    with pytest.raises(ConfigError, match=next(iter(settings))):
        kind(**settings)
