import numpy as np
import pytest
import torch
from scipy import stats
from tests.unit.kernels import analytic

from scenefw.core.errors import ConfigError
from scenefw.kernels.cameras import stack_cameras
from scenefw.noise.gaussian import Gaussian

CAMERAS = stack_cameras([analytic.camera()])


def seeds(first=0, count=1):
    return torch.arange(first, first + count)


def test_noise_has_the_stated_spread_and_no_bias():
    depth = torch.full((1, 240, 320), 1.5)
    error = Gaussian(sigma=0.004).apply(depth, CAMERAS, seeds()) - depth
    assert error.std().item() == pytest.approx(0.004, rel=0.02)
    assert abs(error.mean().item()) < 1e-4


def test_missing_depth_stays_missing_and_the_input_unchanged():
    depth = torch.full((1, 240, 320), 0.001)
    depth[:, ::2] = 0
    before = depth.clone()
    noisy = Gaussian(sigma=0.01).apply(depth, CAMERAS, seeds())
    assert torch.equal(depth, before)
    assert torch.equal(noisy > 0, depth > 0)


def test_the_seed_decides():
    depth = torch.ones(1, 240, 320)
    noise = Gaussian()
    first, again = (noise.apply(depth, CAMERAS, seeds(3)) for _ in range(2))
    assert torch.equal(first, again)
    assert not torch.equal(first, noise.apply(depth, CAMERAS, seeds(4)))


def test_the_noise_is_normal_and_each_image_has_its_own():
    cameras = stack_cameras([analytic.camera()] * 3)
    depth = torch.ones(3, 240, 320)
    noise = (Gaussian(sigma=0.01).apply(depth, cameras, seeds(0, 3)) - 1) / 0.01
    for image in noise.flatten(1).numpy():
        assert stats.kstest(image, "norm").pvalue > 1e-3
    assert np.abs(np.corrcoef(noise.flatten(1).numpy())[np.triu_indices(3, 1)]).max() < 0.02
    alone = Gaussian(sigma=0.01).apply(depth[:1], CAMERAS, seeds(1))
    assert torch.equal(alone, (Gaussian(sigma=0.01).apply(depth, cameras, seeds(0, 3)))[1:2])


@pytest.mark.parametrize("sigma", [-0.001, float("nan")])
def test_a_negative_spread_is_an_error(sigma):
    with pytest.raises(ConfigError, match="sigma"):
        Gaussian(sigma=sigma)


def test_images_draw_their_own_spread_between_the_two():
    count = 400
    cameras = stack_cameras([analytic.camera()] * count)
    depth = torch.ones(count, 24, 32)
    error = Gaussian(sigma=0.01, lowest=0.002).apply(depth, cameras, seeds(0, count)) - depth
    spreads = error.flatten(1).std(dim=1).numpy()
    assert stats.kstest(spreads, stats.uniform(0.002, 0.008).cdf).pvalue > 1e-3
    alone = Gaussian(sigma=0.01, lowest=0.002).apply(depth[:1], CAMERAS, seeds(7))
    assert torch.equal(alone - 1, error[7:8])


def test_the_lowest_may_not_be_above_the_highest():
    with pytest.raises(ConfigError, match="lowest"):
        Gaussian(sigma=0.001, lowest=0.002)


def test_a_share_of_the_images_passes_as_it_is():
    count = 600
    cameras = stack_cameras([analytic.camera()] * count)
    depth = torch.ones(count, 8, 8)
    depth[:, 0] = 0
    noisy = Gaussian(sigma=0.01, lowest=0.0, share=0.3).apply(depth, cameras, seeds(0, count))
    changed = (noisy != depth).flatten(1).any(dim=1)
    assert stats.binomtest(int(changed.sum()), count, 0.3).pvalue > 1e-3
    spreads = (noisy - depth)[changed][:, 1:].flatten(1).std(dim=1, correction=0).numpy()
    # Which images are disturbed says nothing of how much they are
    assert stats.kstest(spreads / 0.01, stats.uniform().cdf).pvalue > 1e-3
    with pytest.raises(ConfigError, match="share"):
        Gaussian(share=1.5)


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0])
def test_depth_that_is_not_a_number_is_missing(share):
    cameras = stack_cameras([analytic.camera()] * 20)
    depth = torch.ones(20, 8, 8)
    depth[:, ::2] = torch.nan
    noisy = Gaussian(sigma=0.01, share=share).apply(depth, cameras, seeds(0, 20))
    assert (noisy[:, ::2] == 0).all()
    assert (noisy[:, 1::2] > 0.9).all()
