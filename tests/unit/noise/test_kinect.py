import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from tests.unit.kernels import analytic
from tests.unit.noise import reference

from scenefw.core.batches import CameraBatch
from scenefw.core.errors import ConfigError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera
from scenefw.kernels.cameras import stack_cameras
from scenefw.noise.kinect import Kinect

FACING = Camera().resized(320, 240)
QUIET = {"lateral": 0.0, "axial": 0.0, "dropout": 0.0, "disparity_step": 1e-4}


def apply(depth, view=FACING, seed=0, **settings):
    cameras = stack_cameras([view] * len(depth))
    return Kinect(**settings).apply(depth, cameras, torch.arange(len(depth)) + 1000 * seed)


def wall(z):
    return torch.full((1, 240, 320), z)


def board_before_wall(near=0.8, far=1.2):
    """A board in columns 100 to 199 before a wall."""
    depth = wall(far)
    depth[:, :, 100:200] = near
    return depth


@pytest.mark.parametrize("z", [0.8, 1.5, 3.0])
def test_axial_noise_grows_as_measured(z):
    noisy = apply(wall(z), **{**QUIET, "axial": 1.0})
    error = (noisy - z)[noisy > 0]
    assert error.std().item() == pytest.approx(0.0012 + 0.0019 * (z - 0.4) ** 2, rel=0.03)
    assert abs(error.mean().item()) < 2e-4


def test_disparity_comes_in_steps():
    ramp = torch.linspace(0.6, 3.0, 240 * 320).view(1, 240, 320)
    stepped = apply(ramp, **{**QUIET, "disparity_step": 0.125})
    disparity = FACING.fx * 0.075 / stepped[stepped > 0] / 0.125
    assert (disparity - disparity.round()).abs().max() < 1e-3
    spacing = np.diff(np.unique(stepped[stepped > 0].numpy()).astype(np.float64))
    # z^2 / (f b) * step: quadratic in depth
    assert spacing.max() / spacing.min() > 10
    half = ramp[stepped > 0] ** 2 / (FACING.fx * 0.075) * 0.125 / 2
    assert ((stepped - ramp).abs()[stepped > 0] <= 1.15 * half).all()


@pytest.mark.parametrize(
    ("baseline", "columns"), [(0.075, slice(0, 100)), (-0.075, slice(200, 320))]
)
def test_the_shadow_falls_away_from_the_projector(baseline, columns):
    near, far = 0.8, 1.2
    lost = apply(board_before_wall(near, far), **QUIET, baseline=baseline) == 0
    per_row = lost[0].sum(dim=1).float().mean().item()
    inside = lost[0][:, columns].sum(dim=1).float().mean().item()
    width = FACING.fx * 0.075 * (1 / near - 1 / far)  # disparity of the board over the wall's
    assert inside == pytest.approx(width, abs=3)
    assert per_row - inside <= 4  # the board's other edge frays


def test_a_plain_wall_has_no_shadow():
    assert (apply(wall(1.0), **QUIET) > 0).all()


def test_grazing_surfaces_are_lost():
    shares = []
    for height in (1.0, 0.28, 0.1):
        view = FACING.moved(look_at((0.0, 0.0, height), (1.0, 0.0, 0.0)))
        floor = analytic.depth([analytic.Sphere((0, 0, -9), 1.0)], view)[None]
        seen = (floor > 0.5) & (floor < 1.5)
        lost = apply(floor, view, **QUIET, nearest=0.0, farthest=1e6) == 0
        shares.append(lost[seen].float().mean().item())
    assert shares[0] < 0.005
    assert 0.01 < shares[1] < 0.6
    assert shares[2] > 0.6


def test_lateral_noise_frays_edges_only():
    depth = wall(1.0)
    depth[:, :120] = 1.004  # too small a step for shadow and grazing
    changed = apply(depth, **{**QUIET, "lateral": 0.7}) - depth
    rows = (changed.abs() > 2e-3).float().mean(dim=(0, 2))
    assert 0.1 < rows[119] < 0.5
    assert 0.1 < rows[120] < 0.5
    assert rows[:115].max() == 0
    assert rows[125:].max() == 0


def test_dropout_and_range():
    lost = apply(wall(1.0), **{**QUIET, "dropout": 0.1}) == 0
    assert lost.float().mean().item() == pytest.approx(0.1, abs=0.005)
    assert (apply(wall(0.3), **QUIET) == 0).all()
    assert (apply(wall(9.0), **QUIET) == 0).all()


def test_nothing_comes_from_nothing():
    assert (apply(wall(0.0)) == 0).all()
    assert (apply(wall(float("nan"))) == 0).all()
    assert (apply(wall(float("inf"))) == 0).all()


def test_images_of_a_batch_differ_in_noise_but_not_in_kind():
    noisy = apply(wall(1.0).expand(2, -1, -1).contiguous())
    assert not torch.equal(noisy[0], noisy[1])
    spread = [image[image > 0].std().item() for image in noisy]
    assert spread[0] == pytest.approx(spread[1], rel=0.05)


@given(st.integers(0, 2**31), st.floats(0.5, 5.0))
def test_the_seed_decides(seed, z):
    depth = torch.full((1, 24, 32), z)
    view = FACING.resized(32, 24)
    first, again = (apply(depth, view, seed) for _ in range(2))
    assert torch.equal(first, again)
    assert torch.isfinite(first).all()
    assert (first >= 0).all()


def clutter(views=4):
    """Balls on the floor from several places: edges, shadows, grazing floor."""
    balls = [
        analytic.Sphere((0.2 * i - 0.3, 0.1 * (i % 3), 0.1), 0.08 + 0.01 * i) for i in range(4)
    ]
    eyes = [(math.cos(a), math.sin(a), 0.3 + 0.1 * a) for a in np.arange(views)]
    cameras = [FACING.resized(160, 120).moved(look_at(eye, (0.0, 0.0, 0.1))) for eye in eyes]
    depth = torch.stack([analytic.depth(balls, view) for view in cameras])
    return torch.where(depth < 4, depth, 0.0), stack_cameras(cameras)


@pytest.mark.parametrize("baseline", [0.075, -0.075])
def test_the_shadow_is_that_of_whole_array_operations(baseline):
    depth, cameras = clutter()
    sharp = {**QUIET, "grazing_from": 89.99, "grazing_to": 90.0, "baseline": baseline}
    found = Kinect(**sharp).apply(depth, cameras, torch.arange(4)) == 0
    expected = reference.kinect(depth, cameras, torch.Generator(), **sharp) == 0
    assert 0.005 < (expected & (depth > 0)).float().mean() < 0.5
    assert (found != expected).float().mean() < 1e-4  # rounding may move a border


def test_grazing_pixels_are_lost_as_often_as_in_whole_array_operations():
    depth, cameras = clutter()
    settings = {**QUIET, "grazing_from": 50.0, "grazing_to": 88.0}
    draws, kinect = 40, Kinect(**settings)
    lost = [kinect.apply(depth, cameras, torch.arange(4) + 4 * i) == 0 for i in range(draws)]
    generator = torch.Generator().manual_seed(0)
    expected = [reference.kinect(depth, cameras, generator, **settings) == 0 for _ in range(draws)]
    ours, theirs = (torch.stack(x).float().mean(dim=0) for x in (lost, expected))
    assert ((theirs > 0.1) & (theirs < 0.9)).float().mean() > 0.05
    assert ours.mean().item() == pytest.approx(theirs.mean().item(), abs=2e-3)
    error = (ours - theirs)[(theirs > 0) & (theirs < 1)]
    assert error.std() < 1.2 * math.sqrt(2 * 0.25 / draws)


@pytest.mark.parametrize("settings", [{}, {"disparity_step": 0.031, "lateral": 0.3}])
def test_all_noise_together_is_distributed_as_in_whole_array_operations(settings):
    depth, cameras = clutter()
    generator = torch.Generator().manual_seed(0)
    ours = [Kinect(**settings).apply(depth, cameras, torch.arange(4) + 4 * i) for i in range(4)]
    theirs = [reference.kinect(depth, cameras, generator, **settings) for _ in range(4)]
    errors, holes = [], []
    for noisy in (torch.stack(ours), torch.stack(theirs)):
        seen = (noisy > 0) & (depth > 0)
        errors.append((noisy - depth)[seen].numpy())
        holes.append((noisy == 0).float().mean().item())
    assert holes[0] == pytest.approx(holes[1], abs=2e-3)
    assert errors[0].mean() == pytest.approx(errors[1].mean(), abs=5e-4)
    assert errors[0].std() == pytest.approx(errors[1].std(), rel=0.05)
    assert stats.ks_2samp(errors[0], errors[1]).statistic < 0.01


def test_an_image_is_disturbed_alike_in_any_batch():
    depth, cameras = clutter()
    together = Kinect().apply(depth, cameras, torch.tensor([5, 6, 2**62, 8]))
    one = CameraBatch(160, 120, cameras.intrinsics[2:3], cameras.T_world_camera[2:3])
    alone = Kinect().apply(depth[2:3].clone(), one, torch.tensor([2**62]))
    assert torch.equal(together[2:3], alone)


@pytest.mark.parametrize(
    "settings",
    [
        {"baseline": 0.0},
        {"disparity_step": 0.0},
        {"lateral": -1.0},
        {"axial": -1.0},
        {"grazing_from": 88.0},
        {"dropout": 1.5},
        {"nearest": 9.0},
    ],
)
def test_impossible_settings_are_named(settings):
    with pytest.raises(ConfigError, match=next(iter(settings))):
        Kinect(**settings)


def test_a_share_of_the_images_passes_as_it_is():
    depth = wall(1.3).repeat(60, 1, 1)[:, :24, :32]
    camera = Camera().resized(32, 24)
    noisy = apply(depth, camera, share=0.5)
    untouched = (noisy == depth).flatten(1).all(dim=1).sum().item()
    assert 15 <= untouched <= 45
    assert (apply(depth, camera, share=0.0) == depth).all()
    assert not (apply(depth, camera) == depth).flatten(1).all(dim=1).any()
