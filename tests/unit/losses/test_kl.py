from dataclasses import replace

import pytest
import torch
from tests.unit.losses.volumes import random_pair

from scenefw.core.errors import ConfigError
from scenefw.losses.kl import KLDivergence


def test_it_is_the_divergence_that_torch_computes():
    prediction, batch = random_pair()
    mean, log_variance = (prediction.statistics[n].detach() for n in ("mean", "log_variance"))
    posterior = torch.distributions.Normal(mean, (0.5 * log_variance).exp())
    prior = torch.distributions.Normal(torch.zeros_like(mean), torch.ones_like(mean))
    expected = torch.distributions.kl_divergence(posterior, prior).sum(dim=1).mean()
    assert float(KLDivergence()(prediction, batch)) == pytest.approx(float(expected), rel=1e-5)


def test_a_network_without_a_posterior_is_an_error():
    prediction, batch = random_pair()
    with pytest.raises(ConfigError, match="log_variance"):
        KLDivergence()(replace(prediction, statistics={}), batch)


def test_free_nats_cost_nothing_and_teach_nothing():
    prediction, batch = random_pair()
    whole = KLDivergence()(prediction, batch)
    below, above = (KLDivergence(free=f * float(whole))(prediction, batch) for f in (0.5, 2.0))
    assert torch.equal(below, whole)
    assert float(above.detach()) == pytest.approx(2 * float(whole))
    above.backward()
    assert not prediction.statistics["mean"].grad.any()


def test_a_negative_allowance_is_an_error():
    with pytest.raises(ConfigError, match="free = "):
        KLDivergence(free=-1.0)
