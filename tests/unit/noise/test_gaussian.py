import pytest
import torch
from tests.unit.kernels import analytic

from scenefw.core.errors import ConfigError
from scenefw.kernels.cameras import stack_cameras
from scenefw.noise.gaussian import Gaussian

CAMERAS = stack_cameras([analytic.camera()])


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


def test_noise_has_the_stated_spread_and_no_bias():
    depth = torch.full((1, 240, 320), 1.5)
    error = Gaussian(sigma=0.004).apply(depth, CAMERAS, generator()) - depth
    assert error.std().item() == pytest.approx(0.004, rel=0.02)
    assert abs(error.mean().item()) < 1e-4


def test_missing_depth_stays_missing_and_the_input_unchanged():
    depth = torch.full((1, 240, 320), 0.001)
    depth[:, ::2] = 0
    before = depth.clone()
    noisy = Gaussian(sigma=0.01).apply(depth, CAMERAS, generator())
    assert torch.equal(depth, before)
    assert torch.equal(noisy > 0, depth > 0)


def test_the_generator_decides():
    depth = torch.ones(1, 240, 320)
    noise = Gaussian()
    first, again = (noise.apply(depth, CAMERAS, generator(3)) for _ in range(2))
    assert torch.equal(first, again)
    assert not torch.equal(first, noise.apply(depth, CAMERAS, generator(4)))


@pytest.mark.parametrize("sigma", [-0.001, float("nan")])
def test_a_negative_spread_is_an_error(sigma):
    with pytest.raises(ConfigError, match="sigma"):
        Gaussian(sigma=sigma)
