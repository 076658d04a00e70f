import numpy as np
import pytest
import torch

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import ShapeInstanceBatch
from scenefw.models.shape_instance_vae import ShapeInstanceVAE

SMALL = {
    "latent_size": 6,
    "bottleneck": 5,
    "condition_widths": (4, 6, 8, 8, 8),
    "encoder_widths": (4, 6, 8, 8, 8),
    "decoder_widths": (8, 8, 8, 8, 8),
    "stem_width": 4,
    "branch_width": 4,
}


def network(resolution=16, **changes):
    torch.manual_seed(0)
    return ShapeInstanceVAE(resolution, **{**SMALL, **changes})


def batch(resolution=16, count=2, channels=2, seed=0):
    generator = torch.Generator().manual_seed(seed)
    size = (resolution,) * 3
    draws = (torch.rand(count, c, *size, generator=generator) * 2 - 1 for c in (channels, 1, 3))
    return ShapeInstanceBatch(*draws)


@pytest.mark.parametrize("resolution", [8, 16, 32, 64])
@pytest.mark.parametrize("channels", [1, 2])
def test_outputs_have_the_size_of_the_grid(resolution, channels):
    count = 2
    model = network(resolution, channels=channels)
    found = model(batch(resolution, count, channels), torch.Generator().manual_seed(0))
    size = (resolution,) * 3
    assert found.tsdf.shape == found.partial.shape == (count, 1, *size)
    assert found.votes.shape == (count, 3, *size)
    assert found.latent.shape == found.statistics["mean"].shape == (count, 6)


def test_every_weight_gets_a_gradient():
    model = network(32, zero_share=0.0, prior_share=0.0)
    found = model(batch(32, 3), torch.Generator().manual_seed(0))
    (found.tsdf.square().mean() + found.votes.square().mean() + found.partial.sum()).backward()
    without = [n for n, p in model.named_parameters() if p.grad is None or not p.grad.any()]
    assert without == []


def test_prediction_leaves_the_encoder_alone():
    model = network().eval()
    condition = batch().condition
    before = model.predict(condition)
    for parameter in model.encoder.parameters():
        torch.nn.init.constant_(parameter, 1e6)
    assert torch.equal(before.tsdf, model.predict(condition).tsdf)


def test_no_code_is_the_zero_code_and_training_with_it_agrees():
    model = network(zero_share=1.0, prior_share=0.0).eval()
    data = batch()
    zero = model.predict(data.condition, torch.zeros(2, 6))
    assert torch.equal(zero.tsdf, model.predict(data.condition).tsdf)
    trained = model(data, torch.Generator().manual_seed(0))
    np.testing.assert_allclose(trained.tsdf.clamp(-1, 1).detach(), zero.tsdf.detach(), atol=1e-6)


def test_several_codes_per_condition_come_sample_after_sample():
    model = network().eval()
    condition = batch().condition
    codes = torch.randn(3, 2, 6, generator=torch.Generator().manual_seed(1))
    together = model.predict(condition, codes.reshape(6, 6))
    for i in range(3):
        alone = model.predict(condition, codes[i])
        np.testing.assert_allclose(
            together.votes[2 * i : 2 * i + 2].detach(), alone.votes.detach(), atol=1e-5
        )


def replaced(model, data, seed=0):
    """Codes of the posterior means, and those that a training decodes instead."""
    maps, view = model.condition.encode(data.condition)
    latent = torch.full((len(view), model.latent_size), 50.0)
    generator = torch.Generator().manual_seed(seed)
    return model._replace(latent, view, maps, data.tsdf, generator)


@pytest.mark.parametrize("candidates", [1, 3])
def test_shares_of_replaced_codes(candidates):
    model = network(8, zero_share=0.3, prior_share=0.4, candidates=candidates).eval()
    codes = replaced(model, batch(8, 200))
    assert (codes == 0).all(dim=1).sum() == (codes[:60] == 0).all(dim=1).sum() == 60
    assert (codes == 50).all(dim=1).sum() == (codes[140:] == 50).all(dim=1).sum() == 60
    prior = codes[60:140]
    assert float(prior.mean()) == pytest.approx(0, abs=0.15)
    assert float(prior.std()) == pytest.approx(1, abs=0.15)


@torch.no_grad()
def test_the_best_of_many_codes_is_trained_on():
    model = network(16, zero_share=0.0, prior_share=1.0, candidates=5)
    model.decoder.linear[0].weight.mul_(20)  # else one code is best for every scene
    data = batch(16, 3)
    model(data, torch.Generator().manual_seed(1))  # batch statistics other than the initial ones
    model.eval()
    chosen = replaced(model, data, seed=5)
    generator = torch.Generator().manual_seed(5)
    drawn = [torch.randn(3, 6, generator=generator) for _ in range(5)]
    errors = torch.stack(
        [
            (model.predict(data.condition, c).tsdf - data.tsdf).abs().mean((1, 2, 3, 4))
            for c in drawn
        ]
    )
    best = errors.argmin(dim=0)
    assert torch.equal(chosen, torch.stack([drawn[k][i] for i, k in enumerate(best)]))
    assert len(set(best.tolist())) > 1


def test_choosing_codes_leaves_the_training_mode_and_its_statistics():
    model, data = network(16, zero_share=0.0, prior_share=1.0, candidates=2), batch(16, 4)
    before = {n: b.clone() for n, b in model.decoder.named_buffers()}
    maps, view = model.condition.encode(data.condition)
    model._best([torch.zeros(4, 6), torch.ones(4, 6)], view, maps, data.tsdf)
    assert all(m.training for m in model.modules())
    assert all(torch.equal(b, before[n]) for n, b in model.decoder.named_buffers())


def test_the_last_layer_can_copy_what_is_visible():
    model, data = network(16).eval(), batch(16)
    head = model.decoder.tsdf
    torch.nn.init.zeros_(head.weight)
    torch.nn.init.zeros_(head.bias)
    with torch.no_grad():
        for i in range(8):  # the first eight of the condition's channels are the partial TSDF
            head.weight[i, SMALL["branch_width"] + i, 0, 0, 0] = 1
    found = model.predict(data.condition).tsdf
    np.testing.assert_allclose(found.detach(), data.condition[:, :1], atol=1e-6)


def test_codes_follow_the_generator_alone():
    model, data = network().eval(), batch()

    def latent(seed):
        return model(data, torch.Generator().manual_seed(seed)).latent

    assert torch.equal(latent(1), latent(1))
    assert not torch.equal(latent(1), latent(2))
    found = model(data)
    assert torch.equal(found.latent, found.statistics["mean"])


def test_it_learns_one_batch():
    model, data = network(zero_share=0.5, prior_share=0.0), batch(count=2)
    data = ShapeInstanceBatch(data.condition, (data.tsdf * 0.3).clamp(-1, 1), data.votes * 0.3)
    optimizer = torch.optim.Adam(model.parameters(), lr=5e-3)
    generator, errors = torch.Generator().manual_seed(0), []
    for _ in range(60):
        found = model(data, generator)
        loss = (found.tsdf - data.tsdf).square().mean() + (found.votes - data.votes).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        errors.append(float(loss.detach()))
    assert errors[-1] < 0.75 * errors[5]


def test_the_recipe_rebuilds_it():
    model = network(16, channels=1, zero_share=0.1)
    arguments = {k: v for k, v in model.recipe.items() if k != "_target_"}
    again = ShapeInstanceVAE(**arguments)
    again.load_state_dict(model.state_dict())
    assert again.recipe == model.recipe
    assert model.recipe["_target_"].endswith("ShapeInstanceVAE")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"resolution": 48}, "power of two"),
        ({"resolution": 4}, "power of two"),
        ({"channels": 3}, "channels"),
        ({"zero_share": 0.7, "prior_share": 0.4}, "prior_share"),
        ({"candidates": 0}, "candidates"),
        ({"decoder_widths": (1, 2, 3)}, "decoder_widths"),
    ],
)
def test_unusable_settings_are_named(changes, text):
    with pytest.raises(ConfigError, match=text):
        ShapeInstanceVAE(**{"resolution": 16, **SMALL, **changes})


def test_unfit_inputs_are_named():
    model = network().eval()
    with pytest.raises(InputError, match="condition has shape"):
        model.predict(torch.zeros(1, 1, 16, 16, 16))
    with pytest.raises(InputError, match="latent codes"):
        model.predict(torch.zeros(2, 2, 16, 16, 16), torch.zeros(3, 6))
