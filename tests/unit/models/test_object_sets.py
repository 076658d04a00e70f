import itertools

import pytest
import torch
from tests.unit.models.sets import boxes

from scenefw import registry
from scenefw.core.errors import ConfigError, InputError
from scenefw.models.object_codes import CodeAttention, SpatialBroadcast, codes_at, largest_cells
from scenefw.models.set_autoencoder import SetAutoencoder
from scenefw.models.set_decoder import SetDecoder
from scenefw.models.set_vae import SetVAE

SMALL = {"encoder_widths": (8, 6, 4, 4), "decoder_widths": (8, 6, 4, 4), "code_size": 8}
VIEWS = {"condition_widths": (4, 4, 4, 4, 4), "bottleneck": 4}
ALL = {"existence": True, "centres": True, "attention": True}


def test_the_chosen_cells_have_the_largest_sum_of_all_subsets():
    """Eq. 6.1 by trying every subset."""
    features = torch.randn(2, 5, 2, 2, 2, generator=torch.Generator().manual_seed(1))
    cells = largest_cells(features, 3)
    for scene, chosen in enumerate(cells):
        means = features[scene].mean(dim=0).flatten()
        best = max(itertools.combinations(range(8), 3), key=lambda i: float(means[list(i)].sum()))
        assert sorted(chosen.tolist()) == list(best)
    codes = codes_at(features, cells)
    for scene, slot in itertools.product(range(2), range(3)):
        at = torch.unravel_index(cells[scene, slot], (2, 2, 2))
        assert torch.equal(codes[scene, slot], features[(scene, slice(None), *at)])


def test_a_broadcast_code_is_everywhere_and_knows_where():
    codes = torch.randn(2, 5)
    volume = SpatialBroadcast(4)(codes)
    assert volume.shape == (2, 8, 4, 4, 4)
    assert torch.equal(volume[:, :5, 3, 1, 2], codes)
    assert volume[1, 5:, 3, 1, 2].tolist() == pytest.approx([0.75, -0.25, 0.25])


@pytest.mark.parametrize("resolution", [16, 32, 64])
@pytest.mark.parametrize("network", [SetAutoencoder, SetVAE])
def test_any_resolution_gives_objects_of_its_size(network, resolution):
    more = VIEWS if network is SetVAE else {}
    model = network(resolution, 3, **SMALL, **more, **ALL)
    prediction = model(boxes(resolution))
    assert prediction.logits.shape == (2, 3, *(resolution,) * 3)
    assert prediction.codes.shape == (2, 3, 8)
    assert prediction.features.shape == (2, 8, 4, 4, 4)
    assert prediction.existence.shape == (2, 3)
    assert prediction.centres.shape == (2, 3, 3)
    assert prediction.logits.median() < -2  # at first, all is empty


@pytest.mark.parametrize(
    ("name", "least", "most"), [("set_autoencoder", 2.0e6, 2.6e6), ("set_vae", 1.8e6, 2.3e6)]
)
def test_networks_are_of_the_thesiss_size(name, least, most):
    model = registry.build("model", name, resolution=64)
    assert least < sum(p.numel() for p in model.parameters()) < most


def test_each_network_sees_what_it_is_said_to_see():
    """The autoencoders one thing alone, the VAE both."""
    batch, other = boxes(seed=0), boxes(seed=1)
    seen = {"occupancy": [], "view": []}
    torch.manual_seed(0)
    networks = {
        "occupancy": SetAutoencoder(16, 3, "occupancy", **SMALL),
        "view": SetAutoencoder(16, 3, "view", **SMALL),
        "both": SetVAE(16, 3, **SMALL, **VIEWS),
    }
    changed = {
        "occupancy": type(batch)(batch.condition, other.instances, batch.present, batch.centres),
        "view": type(batch)(other.condition, batch.instances, batch.present, batch.centres),
    }
    with torch.no_grad():
        for name, network in networks.items():
            first = network.eval()(batch).logits
            for what, variant in changed.items():
                if not torch.equal(first, network(variant).logits):
                    seen[what].append(name)
    assert seen == {"occupancy": ["occupancy", "both"], "view": ["view", "both"]}


@torch.no_grad()
def test_every_object_is_decoded_on_its_own():
    torch.manual_seed(0)
    decoder = SetDecoder(4, [4, 8], [4, 4], [3, 2]).eval()
    codes = torch.randn(2, 3, 4)
    maps = [torch.randn(2, 3, 4, 4, 4), torch.randn(2, 2, 8, 8, 8)]
    together = decoder(codes, maps)
    alone = decoder(codes[1:, 2:], [one[1:] for one in maps])
    torch.testing.assert_close(together[1:, 2:], alone)
    moved = decoder(codes, [maps[0], maps[1].roll(1, 2)])
    assert not torch.allclose(together, moved)


@torch.no_grad()
def test_attention_lets_codes_see_each_other_in_any_order():
    torch.manual_seed(0)
    attention, codes = CodeAttention(8), torch.randn(1, 4, 8)
    refined = attention(codes)
    order = [2, 0, 3, 1]
    torch.testing.assert_close(attention(codes[:, order]), refined[:, order])
    changed = torch.cat([codes[:, :3], torch.randn(1, 1, 8)], dim=1)
    assert not torch.allclose(attention(changed)[:, 0], refined[:, 0])


@torch.no_grad()
def test_what_is_drawn_depends_on_the_generator_alone():
    torch.manual_seed(0)
    model = SetVAE(16, 3, **SMALL, **VIEWS).eval()
    batch = boxes()
    first, again = (model(batch, torch.Generator().manual_seed(3)).latent for _ in range(2))
    assert torch.equal(first, again)
    mean = model(batch).latent
    assert not torch.allclose(first, mean)
    drawn = model.sample(batch.condition, mean)
    torch.testing.assert_close(drawn.logits, model(batch).logits)


def test_wrong_sizes_are_one_line():
    with pytest.raises(ConfigError, match=r"model\.side is 3"):
        SetAutoencoder(16, side=3)
    with pytest.raises(ConfigError, match=r"model\.slots is 70"):
        SetVAE(16, 70)
    with pytest.raises(ConfigError, match=r"model\.decoder_widths"):
        SetAutoencoder(64, decoder_widths=(8, 8))
    with pytest.raises(ConfigError, match=r"model\.sees is 'depth'"):
        SetAutoencoder(16, sees="depth")
    with pytest.raises(InputError, match=r"\(B, 1, 16, 16, 16\)"):
        SetAutoencoder(16).decompose(torch.zeros(1, 2, 16, 16, 16))


@torch.no_grad()
def test_a_scene_is_composed_of_the_codes_of_two():
    """Objects are removed, added and swapped by their codes, and stay what they were."""
    torch.manual_seed(0)
    model = SetAutoencoder(16, 3, **SMALL).eval()
    first, second = model(boxes(seed=0)), model(boxes(seed=1))
    codes = torch.cat([first.codes[:, :1], second.codes[:, 1:]], dim=1)
    composed = model.head.decoder(codes)
    torch.testing.assert_close(composed[:, 0], first.logits[:, 0])
    torch.testing.assert_close(composed[:, 1:], second.logits[:, 1:])
