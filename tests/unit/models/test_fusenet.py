import pytest
import torch
from omegaconf import OmegaConf

from scenefw import config, registry
from scenefw.core.errors import ConfigError
from scenefw.models.fusenet import FuseNet
from scenefw.models.receptive_field import receptive_field


@pytest.fixture(params=[1, 2])
def network(request):
    torch.manual_seed(0)
    widths, modules = ((4, 6, 6, 8), (1, 2, 2, 3)) if request.param == 1 else ((4, 6, 8), (1, 2, 2))
    network = FuseNet(3, widths, modules, block=request.param).train()
    with torch.no_grad():
        for _ in range(3):  # statistics that are not 0 and 1
            network(*images(48, 64, batch=2))
    return network.eval()


def images(height, width, batch=1, seed=0):
    generator = torch.Generator().manual_seed(seed)
    colour = torch.rand(batch, 3, height, width, generator=generator)
    distance = 0.3 * torch.rand(batch, 1, height, width, generator=generator)
    distance[..., : height // 3, : width // 4] = torch.nan
    return colour, distance


def arguments(network):
    return {key: value for key, value in network.recipe.items() if key != "_target_"}


@torch.no_grad()
def test_it_moves_with_its_input(network):
    colour, distance = images(168, 176)
    whole = network(colour, distance)
    margin = receptive_field(network.body).margin
    for down, right in ((8, 0), (16, 24)):
        part = network(colour[..., down:, right:], distance[..., down:, right:])
        inner = (..., slice(margin, None), slice(margin, None))
        torch.testing.assert_close(part[inner], whole[..., down:, right:][inner])


@torch.no_grad()
@pytest.mark.parametrize("size", [(5, 9), (41, 33), (8, 8)])
def test_any_size_goes(network, size):
    scores = network(*images(*size, batch=2))
    assert scores.shape == (2, 3, *size)
    assert scores.isfinite().all()


@torch.no_grad()
def test_missing_distances_are_not_zero_distances(network):
    colour, distance = images(32, 32)
    filled = torch.where(distance.isfinite(), distance, torch.zeros(()))
    assert not torch.allclose(network(colour, distance), network(colour, filled))


@torch.no_grad()
def test_offset_and_scale_are_units(network):
    other = FuseNet(**{**arguments(network), "offset": 0.2, "scale": 0.01})
    other.load_state_dict(network.state_dict())
    colour, distance = images(32, 32)
    torch.testing.assert_close(
        other.eval()(colour, 0.2 + distance * 0.1), network(colour, distance), rtol=1e-4, atol=1e-4
    )


@torch.no_grad()
@pytest.mark.parametrize(("seen", "unseen"), [("colour", 1), ("distance", 0)])
def test_one_modality_alone_is_blind_to_the_other(network, seen, unseen):
    alone = FuseNet(**{**arguments(network), "modalities": [seen]})
    alone.load_state_dict(network.state_dict())
    given, other = images(32, 32), images(32, 32, seed=1)
    swapped = list(given)
    swapped[unseen] = other[unseen]
    torch.testing.assert_close(alone.eval()(*swapped), alone(*given), rtol=0, atol=0)
    swapped = list(other)
    swapped[unseen] = given[unseen]
    assert not torch.allclose(alone(*swapped), alone(*given))


def test_both_encoders_learn(network):
    network.train()(*images(16, 16)).square().sum().backward()
    for name, parameter in network.named_parameters():
        assert parameter.grad.abs().sum() > 0, name


def test_the_thesis_has_eight_modules_and_the_laptop_one_million_weights():
    small = registry.build("model", "fusenet")
    assert sum(p.numel() for p in small.parameters()) < 1e6
    for words, modules, megabytes in (
        (["model=fusenet"], 8, 1),
        (["model=fusenet", "model.widths=[16,24,48,80,112]", "model.modules=[1,2,2,3,2]"], 10, 3),
        (["model=fusenet_blocks"], 9, 4),
        (["model=fusenet", "size.network=wide"], 10, 12),
    ):
        settings = OmegaConf.to_container(config.compose(words).model, resolve=True)
        with torch.device("meta"):
            found = FuseNet(**{k: v for k, v in settings.items() if k != "_target_"})
        assert len(found.body.colour) == len(found.body.depth) == modules
        assert 2 * sum(value.numel() for value in found.state_dict().values()) < megabytes * 1e6


@pytest.mark.parametrize(
    "wrong",
    [
        {"classes": 1},
        {"modules": (1, 2)},
        {"scale": 0.0},
        {"dropout": 1.0},
        {"block": 0},
        {"modalities": []},
        {"modalities": ["color"]},
    ],
)
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        FuseNet(**{"classes": 3, "widths": (4, 4, 4), "modules": (1, 1, 1), **wrong})
