import numpy as np
import pytest
import torch
from tests.unit.learning import plain
from torch import nn

from scenefw.core.errors import CheckpointError, ConfigError
from scenefw.learning.optimizers import AdamW, Muon
from scenefw.learning.schedules import Progress


def orthogonal(momentum):
    """U V^T of the singular value decomposition, by numpy."""
    u, _, v = np.linalg.svd(momentum, full_matrices=False)
    return u @ v


@pytest.mark.parametrize("shape", [(6, 4, 3, 3, 3), (12, 5), (5, 12)])
def test_muon_moves_weights_by_the_orthogonal_factor_of_their_gradient(shape):
    torch.manual_seed(0)
    model = nn.Module()
    model.weight = nn.Parameter(torch.randn(shape))
    before = model.weight.detach().clone()
    gradient = torch.randn(shape)
    optimizer = Muon(rate=10.0).make(model, 1e-2, 0.0, fused=True)
    model.weight.grad = gradient.clone()
    optimizer.step()
    rows = shape[0]
    columns = before.numel() // rows
    step = (before - model.weight.detach()).reshape(rows, columns).numpy()
    wanted = orthogonal(gradient.reshape(rows, columns).numpy())
    wanted *= 10.0 * 1e-2 * max(1.0, rows / columns) ** 0.5
    # Five iterations leave singular values between 0.7 and 1.2 of what they should be.
    cosine = (step * wanted).sum() / np.linalg.norm(step) / np.linalg.norm(wanted)
    assert cosine > 0.97
    values = np.linalg.svd(step, compute_uv=False) / np.linalg.svd(wanted, compute_uv=False)[0]
    assert values.min() > 0.6
    assert values.max() < 1.3


def test_muon_leaves_norms_and_biases_to_adamw():
    torch.manual_seed(0)
    model = nn.Sequential(nn.Conv2d(3, 8, 3), nn.BatchNorm2d(8), nn.PReLU())
    alone = nn.Sequential(nn.Conv2d(3, 8, 3), nn.BatchNorm2d(8), nn.PReLU())
    alone.load_state_dict(model.state_dict())
    images = torch.randn(4, 3, 6, 6)
    for network, made in ((model, Muon()), (alone, AdamW())):
        optimizer = made.make(network, 1e-2, 1e-2, fused=False)
        network(images).square().sum().backward()
        optimizer.step()
    for (name, one), other in zip(model.named_parameters(), alone.parameters(), strict=True):
        if one.ndim < 2:
            torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-7)
        else:
            assert not torch.allclose(one, other, atol=1e-3), name


def test_weights_without_gradient_are_left_out():
    model = nn.Sequential(nn.Linear(3, 3), nn.Linear(3, 3))
    model[0].requires_grad_(False)
    for made in (AdamW(), Muon()):
        groups = made.make(model, 1e-2, 0.0, fused=False).param_groups
        assert sum(len(group["params"]) for group in groups) == 2


def test_a_training_in_two_calls_equals_one_bit_for_bit(tmp_path):
    options = {"learning": {"optimizer": Muon()}}
    plain.task(tmp_path / "once", steps=7, **options).run()
    for steps in (3, 7):
        plain.task(tmp_path / "twice", steps=steps, **options).run()
    first, second = plain.state(tmp_path / "once"), plain.state(tmp_path / "twice")
    for name, value in first["state_dict"].items():
        assert torch.equal(value, second["state_dict"][name]), name


def test_the_rate_of_matrices_follows_the_schedule(tmp_path):
    task = plain.task(tmp_path, steps=3, learning={"optimizer": Muon(rate=5.0)})
    task.run()
    matrices, rest = task.learning.trainer.optimizers[0].param_groups
    assert rest["lr"] == 1e-2 * task.learning.schedule.factor(Progress(2, 0, 0.0))
    assert matrices["lr"] == pytest.approx(5 * rest["lr"])


@pytest.mark.parametrize(
    "settings", [{"rate": 0.0}, {"rate": -1.0}, {"rate": float("nan")}, {"momentum": 1.0}]
)
def test_settings_out_of_range_are_one_line(settings):
    with pytest.raises(ConfigError, match=next(iter(settings))):
        Muon(**settings)


@pytest.mark.skipif(not hasattr(torch.optim, "Muon"), reason="torch has no Muon before 2.9")
@pytest.mark.parametrize("shape", [(6, 20), (20, 6)])
def test_steps_are_those_of_torch(shape):
    torch.manual_seed(0)
    ours, theirs = (nn.Linear(*reversed(shape), bias=False) for _ in range(2))
    theirs.load_state_dict(ours.state_dict())
    begun = ours.weight.detach().clone()
    peer = torch.optim.Muon(theirs.parameters(), lr=0.2, weight_decay=0.1, momentum=0.95)
    mine = Muon(rate=20.0).make(ours, 1e-2, 0.1, fused=False)
    for _ in range(4):
        gradient = torch.randn(shape)
        for model, optimizer in ((ours, mine), (theirs, peer)):
            model.weight.grad = gradient.clone()
            optimizer.step()
    moved = float((theirs.weight.detach() - begun).norm())
    assert float((ours.weight - theirs.weight).detach().norm()) < 0.02 * moved  # bfloat16 there


def test_the_order_of_channels_in_memory_changes_no_step():
    torch.manual_seed(0)
    layers = [(nn.Conv3d(1, 4, 3), nn.Conv3d(4, 6, 3), nn.Conv3d(6, 5, 1)) for _ in range(2)]
    models = [nn.Sequential(*chosen) for chosen in layers]
    models[1].load_state_dict(models[0].state_dict())
    models[1].to(memory_format=torch.channels_last_3d)
    assert not models[1][1].weight.is_contiguous()
    gradients = [[torch.randn(p.shape) for p in models[0].parameters()] for _ in range(3)]
    for model in models:
        optimizer = Muon().make(model, 1e-2, 1e-2, fused=False)
        for gradient in gradients:
            for weight, value in zip(model.parameters(), gradient, strict=True):
                weight.grad = torch.empty_like(weight).copy_(value)
            optimizer.step()
    assert not models[1][1].weight.is_contiguous()
    for one, other in zip(models[0].parameters(), models[1].parameters(), strict=True):
        assert torch.equal(one, other)


def test_a_state_of_an_earlier_version_is_one_line():
    optimizer = Muon().make(nn.Linear(2, 2), 1e-2, 0.0, fused=False)
    earlier = optimizer.state_dict()
    earlier["param_groups"][0]["use_muon"] = True
    with pytest.raises(CheckpointError, match=r"earlier version.*fresh=true"):
        optimizer.load_state_dict(earlier)
