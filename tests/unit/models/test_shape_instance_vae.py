import numpy as np
import pytest
import torch

from scenefw.core.batches import ShapeInstanceBatch
from scenefw.core.errors import ConfigError, InputError
from scenefw.models.shape_instance_vae import ShapeInstanceVAE

SMALL = {
    "latent_size": 6,
    "bottleneck": 5,
    "condition_widths": (4, 6, 8, 8, 8),
    "encoder_widths": (4, 6, 8, 8, 8),
    "decoder_widths": (8, 8, 8, 8, 8),
    "stem_width": 4,
    "branch_width": 4,
    "code_width": 0,
    "prior_share": 0.4,
}


def network(resolution=16, **changes):
    torch.manual_seed(0)
    return ShapeInstanceVAE(resolution, **{**SMALL, **changes})


def batch(resolution=16, count=2, channels=2, seed=0):
    generator = torch.Generator().manual_seed(seed)
    size = (resolution,) * 3
    draws = (torch.rand(count, c, *size, generator=generator) * 2 - 1 for c in (channels, 1, 3))
    condition, tsdf, votes = draws
    return ShapeInstanceBatch(condition, {"tsdf": tsdf, "votes": votes})


@pytest.mark.parametrize("resolution", [8, 16, 32, 64])
@pytest.mark.parametrize("channels", [1, 2])
def test_outputs_have_the_size_of_the_grid(resolution, channels):
    count = 2
    model = network(resolution, channels=channels)
    found = model(batch(resolution, count, channels), torch.Generator().manual_seed(0))
    size = (resolution,) * 3
    assert found.tsdf.shape == found.partial.shape == (count, 1, *size)
    assert found.votes.shape == (count, 3, *size)
    assert found.latent.shape == found.statistics["mean"].shape == (1, 6)


def test_every_weight_gets_a_gradient():
    model = network(32, zero_share=0.0, prior_share=0.0, code_width=2)
    found = model(batch(32, 3), torch.Generator().manual_seed(0))
    (found.tsdf.square().mean() + found.votes.square().mean() + found.partial.sum()).backward()
    without = [n for n, p in model.named_parameters() if p.grad is None or not p.grad.any()]
    assert without == []


def test_without_channels_no_view_matters_and_codes_do():
    model = network(16, channels=0, zero_share=0.0, prior_share=0.0)
    found = model(batch(16, 2), torch.Generator().manual_seed(0))
    assert found.latent.shape == (2, 6)
    model.eval()
    codes = torch.randn(2, 6, generator=torch.Generator().manual_seed(1))
    one, other = (model.predict(batch(seed=seed).condition, codes).tsdf for seed in (0, 1))
    assert torch.equal(one, other)
    assert not torch.allclose(one[0], one[1])
    assert not torch.allclose(one, model.predict(batch().condition).tsdf)


def test_prediction_leaves_the_encoder_alone():
    model = network().eval()
    condition = batch().condition
    before = model.predict(condition)
    for parameter in model.encoder.parameters():
        torch.nn.init.constant_(parameter, 1e6)
    assert torch.equal(before.tsdf, model.predict(condition).tsdf)


def test_no_code_is_the_zero_code_and_training_with_it_agrees():
    model = network(zero_share=1.0, prior_share=0.0, code_width=2).eval()
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


@pytest.mark.parametrize(("count", "zeros", "drawn"), [(10, 3, 4), (20, 6, 8)])
def test_shares_of_replaced_codes(count, zeros, drawn):
    model, codes = network(8, zero_share=0.3, prior_share=0.4), []
    model.decoder.register_forward_pre_hook(lambda _, given: codes.append(given[0][:, :6]))
    found = model(batch(8, count), torch.Generator().manual_seed(0))
    (code,) = codes
    assert len(code) == count + drawn  # drawn twice
    assert not code[:zeros].any()
    assert code[zeros:].all()
    assert found.redrawn.rows == slice(zeros, zeros + drawn)
    assert len(found.redrawn.tsdf) == drawn
    assert torch.equal(found.latent, code[zeros + drawn : count])
    assert found.statistics["mean"].shape == found.latent.shape
    assert len(found.tsdf) == len(found.votes) == len(found.partial) == count


def test_before_codes_are_drawn_zero_takes_their_place():
    model, codes = network(8, zero_share=0.3, prior_share=0.4), []
    model.decoder.register_forward_pre_hook(lambda _, given: codes.append(given[0][:, :6]))
    found = model(batch(8, 10), torch.Generator().manual_seed(0), draw=False)
    assert found.redrawn is None
    assert len(codes[0]) == 10
    assert not codes[0][:7].any()
    assert codes[0][7:].all()


def test_drawn_codes_come_from_the_standard_normal_distribution():
    model = network(8)
    generator = torch.Generator().manual_seed(0)
    first, second = model._draws(torch.ones(800, 3), generator)
    for drawn in (first, second):
        np.testing.assert_allclose(drawn.mean(dim=0), 0, atol=0.15)
        np.testing.assert_allclose(torch.cov(drawn.T), np.eye(6), atol=0.2)
    np.testing.assert_allclose((first * second).mean(dim=0), 0, atol=0.15)


@pytest.mark.parametrize("resolution", [8, 16])
def test_a_second_code_belongs_to_the_view_of_the_first(resolution):
    model = network(resolution, zero_share=0.0, prior_share=1.0).eval()
    data, codes = batch(resolution, 3), []
    model.decoder.register_forward_pre_hook(lambda _, given: codes.append(given[0][:, :6]))
    found = model(data, torch.Generator().manual_seed(0))
    for rows, tsdf in ((slice(0, 3), found.tsdf), (slice(3, 6), found.redrawn.tsdf)):
        alone = model.predict(data.condition, codes[0][rows]).tsdf
        np.testing.assert_allclose(tsdf.clamp(-1, 1).detach(), alone.detach(), atol=1e-5)


def test_without_posterior_codes_there_is_no_encoder():
    model = network(zero_share=0.5, prior_share=0.5)
    assert model.encoder is None
    found = model(batch(), torch.Generator().manual_seed(0))
    assert found.latent is None
    assert found.statistics == {}
    with pytest.raises(InputError, match="without its encoder"):
        model(batch())


def test_a_map_of_the_code_moves_the_shape_where_there_is_one():
    data = batch()
    for width in (0, 2):
        model = network(code_width=width).eval()
        for parameter in model.decoder.linear.parameters():
            torch.nn.init.zeros_(parameter)
        codes = torch.randn(2, 6, generator=torch.Generator().manual_seed(0))
        apart = (
            model.predict(data.condition, codes).tsdf - model.predict(data.condition).tsdf
        ).abs()
        assert bool(apart.max() > 1e-4) == (width > 0)


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


@pytest.mark.slow
def test_it_learns_one_batch():
    model, data = network(zero_share=0.5, prior_share=0.0), batch(count=2)
    targets = {"tsdf": (data.tsdf * 0.3).clamp(-1, 1), "votes": data.votes * 0.3}
    data = ShapeInstanceBatch(data.condition, targets)
    optimizer = torch.optim.Adam(model.parameters(), lr=5e-3)
    generator, errors = torch.Generator().manual_seed(0), []
    for _ in range(30):
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
