"""Smooth noise of an active stereo camera."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.kernels import analytic

from scenefw.core.errors import ConfigError
from scenefw.kernels.cameras import stack_cameras
from scenefw.noise.stereo import Stereo


def cameras(count):
    return stack_cameras([analytic.camera()] * count)


def seeds(count, first=0):
    return torch.arange(first, first + count)


def disparity_errors(noise, depth, count):
    lenses = cameras(count)
    noisy = noise.apply(depth, lenses, seeds(count))
    scale = noise.baseline * lenses.intrinsics[0, 0]
    return scale / noisy - scale / depth


def test_waves_have_the_stated_spread_whatever_the_depth():
    count = 100
    for depth in (0.6, 1.5):
        flat = torch.full((count, 60, 80), depth)
        noise = Stereo(waves=0.1, wavelengths=(7.0,), window=0)
        errors = disparity_errors(noise, flat, count).double()
        # Amounts are even from 0 to 0.1: their mean square is 0.01 / 3
        assert errors.square().mean().sqrt().item() == pytest.approx(0.1 / 3**0.5, rel=0.15)
        assert abs(errors.mean().item()) < 0.005


def test_waves_are_as_long_as_stated():
    flat = torch.ones(50, 120, 160)
    for length in (5.0, 20.0):
        noise = Stereo(waves=0.1, wavelengths=(length,), window=0)
        errors = disparity_errors(noise, flat, 50)
        steps = [round(0.3 * length), round(1.5 * length)]
        near, far = (
            float((errors[..., step:] * errors[..., :-step]).mean() / errors.square().mean())
            for step in steps
        )
        assert near > 0.6
        assert abs(far) < 0.3


def test_windows_round_a_crease_but_no_jump():
    u = torch.arange(80.0)
    roof = (1.0 - 0.004 * (u - 40).abs()).expand(8, 60, 80)
    step = torch.where(u < 40, 1.0, 1.2).expand(8, 60, 80)
    noise = Stereo(waves=0.0, window=3)
    blunt = (noise.apply(roof.contiguous(), cameras(8), seeds(8)) - roof)[:, 30]
    # The mean of |u| over u = -3 to 3 is 12 / 7
    assert blunt[:, 40].min().item() == pytest.approx(-0.004 * 12 / 7, rel=0.03)
    assert blunt[:, 10:30].abs().max() < 2e-4
    assert torch.allclose(noise.apply(step.contiguous(), cameras(8), seeds(8)), step, atol=1e-5)


def test_some_windows_reach_across_edges():
    """A step in disparity becomes a ramp as wide as the window, in the stated share of images."""
    u = torch.arange(80.0)
    count = 300
    scale = Stereo().baseline * cameras(1).intrinsics[0, 0].item()
    disparity = torch.where(u < 40, 4.0, 5.0).expand(count, 60, 80)
    noise = Stereo(waves=0.0, window=0, shadows=0.0, jump=0.3, ramps=0.4, ramp=3, across=2.3)
    found = scale / noise.apply(scale / disparity, cameras(count), seeds(count))[:, 30]
    ramps = (found - disparity[:, 30]).abs() > 1e-3
    widths = ramps.sum(dim=1)
    # Windows are 0 to 3 pixels, jumps up to between 0.3 and 2.3, of which 1.0 is within 65 %
    assert (widths > 0).double().mean().item() == pytest.approx(0.4 * 0.75 * 0.65, abs=0.06)
    assert set(widths.tolist()) == {0, 2, 4, 6}
    widest = found[widths == 6][0, 36:44]
    expected = torch.tensor(
        [4, 4 + 1 / 7, 4 + 2 / 7, 4 + 3 / 7, 4 + 4 / 7, 4 + 5 / 7, 4 + 6 / 7, 5]
    )
    assert torch.allclose(widest, expected, atol=1e-3)


def test_what_the_right_camera_does_not_see_is_lost():
    """A board 0.6 m away before a wall at 1.2 m: its shadow is as wide as disparities differ."""
    u = torch.arange(80)
    depth = torch.where((u >= 40) & (u < 55), 0.6, 1.2).expand(2, 60, 80).contiguous()
    noise = Stereo(waves=0.0, window=0, shadows=1.0)
    lost = noise.apply(depth, cameras(2), seeds(2))[0] == 0
    width = noise.baseline * cameras(2).intrinsics[0, 0].item() * (1 / 0.6 - 1 / 1.2)
    columns = torch.nonzero(lost[30])[:, 0]
    assert len(columns) == pytest.approx(width, abs=1.0)
    assert columns.max() == 39  # it begins where the board does, on the left
    kept = Stereo(waves=0.0, window=0, shadows=0.0).apply(depth, cameras(2), seeds(2))
    assert torch.allclose(kept, depth, atol=1e-5)


def test_waves_grow_where_a_surface_ends():
    u = torch.arange(80)
    step = torch.where(u < 40, 1.0, 1.4).expand(60, 60, 80).contiguous()
    plain, growing = (
        disparity_errors(Stereo(waves=0.1, window=0, edges=e), step, 60) for e in (0.0, 2.0)
    )
    ratio = growing[:, 20:40, 20:40].abs().mean(dim=(0, 1)) / plain[:, 20:40, 20:40].abs().mean(
        dim=(0, 1)
    )
    middle, end = float(ratio[10]), float(ratio[38 - 20 + 1])
    assert middle == pytest.approx(1.0, abs=1e-3)
    # Of the neighbours 2, 4 and 6 pixels along four ways one way lies beyond the end
    assert end == pytest.approx(1 + 2 / 4, abs=1e-2)


@given(seed=st.integers(0, 2**62), count=st.integers(1, 4))
@settings(max_examples=15, deadline=None)
def test_an_image_depends_on_its_seed_alone_and_holes_stay(seed, count):
    rng = np.random.default_rng(seed)
    depth = torch.from_numpy(rng.uniform(0.4, 2.0, (count, 24, 32)).astype(np.float32))
    depth[torch.from_numpy(rng.random(depth.shape) < 0.2)] = 0
    depth[0, 0, 0] = float("nan")
    noise = Stereo(shadows=0.0, share=0.6)
    numbers = torch.from_numpy(rng.integers(0, 2**62, count))
    noisy = noise.apply(depth, cameras(count), numbers)
    known = torch.nan_to_num(depth) > 0
    assert torch.equal(noisy > 0, known)
    assert torch.isfinite(noisy).all()
    for i in range(count):
        alone = noise.apply(depth[i : i + 1], cameras(1), numbers[i : i + 1])
        assert torch.allclose(alone[0], noisy[i])


def test_the_share_of_disturbed_images():
    flat = torch.ones(400, 6, 8)
    noisy = Stereo(share=0.3, window=0).apply(flat, cameras(400), seeds(400))
    assert (noisy != flat).flatten(1).any(dim=1).float().mean().item() == pytest.approx(
        0.3, abs=0.08
    )


@pytest.mark.parametrize(
    "wrong",
    [
        {"baseline": 0.0},
        {"edges": -1.0},
        {"ramps": 1.5},
        {"ramp": -1},
        {"across": 0.0},
        {"shadows": 1.5},
        {"waves": -1.0},
        {"wavelengths": (0.0,)},
        {"share": 2.0},
    ],
)
def test_bad_settings(wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} = "):
        Stereo(**wrong)
