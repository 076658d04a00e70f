"""Networks without codes: the FC baseline and SSCNet**."""

import pytest
import torch
from torch.nn.functional import l1_loss

from scenefw.core.batches import ShapeInstanceBatch
from scenefw.core.errors import ConfigError, InputError
from scenefw_single_view_benchmarks.baselines.fully_convolutional import FullyConvolutional
from scenefw_single_view_benchmarks.baselines.sscnet import SSCNet

BOTH = {"tsdf": 1, "votes": 3}


def fully_convolutional(resolution=16, outputs=BOTH, channels=2):
    torch.manual_seed(0)
    return FullyConvolutional(resolution, outputs, channels, widths=(4, 6, 8))


def sscnet(resolution=16, outputs=BOTH, channels=2):
    torch.manual_seed(0)
    return SSCNet(resolution, outputs, channels, width=2)


NETWORKS = [fully_convolutional, sscnet]


def batch(resolution=16, count=2):
    size = (resolution,) * 3
    draws = torch.Generator().manual_seed(1)
    condition = torch.rand(count, 2, *size, generator=draws) * 2 - 1
    return ShapeInstanceBatch(condition, dict.fromkeys(BOTH, condition[:, :1]))


@pytest.mark.parametrize("make", NETWORKS)
@pytest.mark.parametrize("resolution", [8, 16, 32])
@pytest.mark.parametrize("channels", [1, 2])
def test_outputs_have_the_size_of_the_grid(make, resolution, channels):
    found = make(resolution, channels=channels).predict(batch(resolution).condition)
    assert {n: tuple(v.shape) for n, v in found.volumes.items()} == {
        n: (2, c, *(resolution,) * 3) for n, c in BOTH.items()
    }
    assert found.tsdf.abs().max() <= 1


@pytest.mark.parametrize("make", NETWORKS)
def test_every_weight_gets_a_gradient(make):
    model = make()
    found = model(batch())
    (found.tsdf.square().mean() + found.votes.square().mean()).backward()
    assert [n for n, p in model.named_parameters() if p.grad is None or not p.grad.any()] == []


@pytest.mark.parametrize("make", NETWORKS)
def test_there_are_no_codes(make):
    model, data = make().eval(), batch()
    assert model.latent_size == 0
    assert model.redraws(8) == 0
    free, drawn = model(data), model(data, torch.Generator().manual_seed(3))
    torch.testing.assert_close(free.tsdf, drawn.tsdf, rtol=0, atol=0)
    torch.testing.assert_close(
        model.predict(data.condition, torch.zeros(2, 0)).votes, free.votes, rtol=0, atol=0
    )
    with pytest.raises(InputError, match="no codes"):
        model.predict(data.condition, torch.zeros(2, 4))


@pytest.mark.parametrize("make", NETWORKS)
@pytest.mark.exhaustive
def test_it_can_learn_a_view_by_heart(make):
    model, data = make(16, {"tsdf": 1}), batch(16, 1)
    target = torch.linspace(-1, 1, 16).expand(1, 1, 16, 16, 16)
    optimiser = torch.optim.Adam(model.parameters(), 1e-2)
    first = l1_loss(model(data).tsdf, target).item()
    for _ in range(60):
        optimiser.zero_grad()
        l1_loss(model(data).tsdf, target).backward()
        optimiser.step()
    assert l1_loss(model(data).tsdf, target).item() < 0.3 * first


@pytest.mark.parametrize(("make", "far"), [(fully_convolutional, 8), (sscnet, 8)])
def test_far_voxels_count(make, far):
    """SSCNet's dilated layers and the levels of the other see far beyond a kernel."""
    model = make(32, {"tsdf": 1}).eval()
    condition = torch.zeros(1, 2, 32, 32, 32, requires_grad=True)
    model.predict(condition + 0.01).tsdf[0, 0, 16, 16, 16].backward()
    places = condition.grad[0].abs().sum(dim=0).nonzero()
    assert (places - 16).abs().max() >= far


@pytest.mark.parametrize("make", NETWORKS)
def test_a_recipe_rebuilds_it(make):
    model = make(channels=1)
    recipe = dict(model.recipe)
    assert recipe.pop("_target_").endswith(type(model).__name__)
    again = type(model)(**recipe)
    again.load_state_dict(model.state_dict())
    condition = batch().condition
    torch.testing.assert_close(
        again.eval().predict(condition).tsdf, model.eval().predict(condition).tsdf
    )


@pytest.mark.parametrize("make", NETWORKS)
def test_wrong_use(make):
    with pytest.raises(ConfigError, match="resolution"):
        make(15)
    with pytest.raises(ConfigError, match="channels"):
        make(channels=3)
    with pytest.raises(InputError, match="checkpoint"):
        make().predict(torch.zeros(1, 2, 8, 8, 8))


def test_no_width():
    with pytest.raises(ConfigError, match="widths"):
        FullyConvolutional(16, BOTH, widths=())
    with pytest.raises(ConfigError, match="width"):
        SSCNet(16, BOTH, width=0)
