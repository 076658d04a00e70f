import numpy as np
import pytest
import torch
from tests.unit.losses.volumes import random_pair

from scenefw.core.errors import ConfigError
from scenefw.losses.mmd import MaximumMeanDiscrepancy, mmd_to_normal


@pytest.mark.parametrize(("size", "variance"), [(2, 1.0), (6, 6.0)])
def test_closed_form_agrees_with_sampling(size, variance):
    rng = np.random.default_rng(0)
    codes = rng.normal(0.7, 0.6, (40, size))
    normal = rng.normal(size=(4000, size))

    def kernel(a, b):
        squared = ((a[:, None] - b[None]) ** 2).sum(-1)
        return np.exp(-squared / (2 * variance))

    own = kernel(codes, codes)
    within = (own.sum() - np.trace(own)) / (40 * 39)
    prior = kernel(normal[:2000], normal[2000:]).mean()
    expected = within - 2 * kernel(codes, normal).mean() + prior
    found = float(mmd_to_normal(torch.from_numpy(codes), variance))
    assert found == pytest.approx(expected, abs=0.01)
    assert found > 0.05


def test_codes_from_the_prior_have_none_on_average():
    rng = np.random.default_rng(1)
    values = [
        float(mmd_to_normal(torch.from_numpy(rng.normal(size=(16, 8))), 8.0)) for _ in range(200)
    ]
    assert abs(np.mean(values)) < 3 * np.std(values) / np.sqrt(200)


def test_descending_it_makes_codes_normal():
    generator = torch.Generator().manual_seed(0)
    codes = (1 + 0.4 * torch.randn(64, 4, generator=generator)).requires_grad_()
    optimizer = torch.optim.Adam([codes], lr=0.1)
    for _ in range(300):
        optimizer.zero_grad()
        mmd_to_normal(codes, 4.0).backward()
        optimizer.step()
    assert float(codes.mean().abs()) < 0.15
    assert 0.8 < float(codes.std()) < 1.2


def test_a_single_code_is_allowed_and_bandwidth_must_be_positive():
    prediction, batch = random_pair(batch=1)
    assert np.isfinite(float(MaximumMeanDiscrepancy()(prediction, batch).detach()))
    with pytest.raises(ConfigError, match="bandwidth"):
        MaximumMeanDiscrepancy(bandwidth=0)
