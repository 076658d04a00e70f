import pytest
import torch
from tests.unit.models.sets import boxes

from scenefw.core.errors import ConfigError
from scenefw.models.set_placed_vae import PlacedSetVAE, _balanced, _divergence

SMALL = {"encoder_widths": (8, 6, 4), "decoder_widths": (8, 4), "code_size": 8, "side": 4}


def model(resolution=16, **options):
    torch.manual_seed(0)
    return PlacedSetVAE(resolution, 3, latent_size=2, **SMALL, **options)


def test_the_divergence_moves_the_prior_rather_than_the_posterior():
    moments = [torch.full((1, 2, 4), value, requires_grad=True) for value in (0.3, 0.1, -0.2, 0.4)]
    of, to = (moments[0], moments[1]), (moments[2], moments[3])
    found = _balanced(of, to)
    torch.testing.assert_close(found, _divergence(of, to))
    found.sum().backward()
    balanced = [one.grad.clone() for one in moments]
    for one in moments:
        one.grad = None
    _divergence(of, to).sum().backward()
    for one, grad, share in zip(moments, balanced, (0.01, 0.01, 0.99, 0.99), strict=True):
        torch.testing.assert_close(grad, share * one.grad, rtol=1e-4, atol=1e-7)


def test_the_divergence_is_that_of_torch():
    generator = torch.Generator().manual_seed(0)
    moments = torch.randn(4, 3, 2, 4, 4, 4, generator=generator)
    of, to = (moments[0], moments[1]), (moments[2], moments[3])
    normals = [torch.distributions.Normal(m, (0.5 * v).exp()) for m, v in (of, to)]
    expected = torch.distributions.kl_divergence(*normals).flatten(1).sum(dim=1)
    torch.testing.assert_close(_divergence(of, to), expected)
    assert _divergence(of, of).abs().max() < 1e-5


@pytest.mark.parametrize(("resolution", "seen"), [(16, None), (32, None), (32, 16)])
def test_it_gives_objects_and_what_was_drawn(resolution, seen):
    prediction = model(resolution, seen_resolution=seen)(boxes(resolution))
    assert prediction.logits.shape == (2, 3, *(resolution,) * 3)
    assert prediction.latent.shape == (2, 2, 4, 4, 4)
    assert prediction.divergence.shape == (2,)
    assert (prediction.divergence > 0).all()
    assert prediction.boxes.shape == (2, 3, 2, 3)


@torch.no_grad()
def test_draws_see_the_view_alone():
    """What is drawn for a view doesn't depend on the scene, that given the scene does."""
    network = model().eval()
    batch, other = boxes(seed=0), boxes(seed=1)
    hidden = type(batch)(batch.condition, other.instances, batch.present, batch.centres)
    assert not torch.equal(network(batch).latent, network(hidden).latent)
    noise = torch.randn(2, *network.latent_shape)
    drawn = network.sample(batch.condition, noise)
    assert not torch.equal(drawn.logits, network.sample(other.condition, noise).logits)
    assert not torch.equal(drawn.logits, network.sample(batch.condition, -noise).logits)


@torch.no_grad()
def test_the_posterior_is_drawn_with_the_generator_alone():
    network = model().eval()
    first, again = (network(boxes(), torch.Generator().manual_seed(3)).latent for _ in range(2))
    assert torch.equal(first, again)
    assert not torch.allclose(first, network(boxes()).latent)


def test_the_scene_reaches_the_objects_through_the_latent_volume():
    """What the posterior sees changes objects, so its gradient is not zero."""
    network = model()
    batch = boxes()
    network(batch).logits.sum().backward()
    assert any(one.grad is not None and one.grad.any() for one in network.posterior.parameters())
    assert all(one.grad is None or not one.grad.any() for one in network.prior.parameters())


def test_wrong_sizes_are_one_line():
    with pytest.raises(ConfigError, match="latent_size = 0"):
        PlacedSetVAE(16, side=4, latent_size=0)
    with pytest.raises(ConfigError, match=r"model\.seen_resolution is 24"):
        PlacedSetVAE(64, seen_resolution=24)
    with pytest.raises(ConfigError, match=r"model\.slots is 70"):
        PlacedSetVAE(16, 70, side=4)
