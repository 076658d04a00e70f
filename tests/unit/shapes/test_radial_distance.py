"""Radial distances beside exact ones, and their gradients beside finite differences."""

import numpy as np
import pytest
import torch

from scenefw.core.batches import SceneParameters
from scenefw.core.types import GridSpec
from scenefw.representations.volumes import scene_volumes
from scenefw.shapes.equal_descriptions import equal_descriptions
from scenefw.shapes.radial_distance import in_frame, radial_distance


def solids(count=40, seed=0, dtype=torch.float64):
    """Half-axes (m), exponents, and points inside, near and far, in the frame of each."""
    random = np.random.default_rng(seed)
    half_axes = random.uniform(0.01, 0.15, (count, 3))
    exponents = np.exp(random.uniform(np.log(1.1), np.log(100), (count, 3)))
    points = random.normal(0, 0.08, (count, 3))
    return tuple(torch.as_tensor(one, dtype=dtype) for one in (points, half_axes, exponents))


def test_it_is_the_distance_to_a_ball():
    points = torch.randn(50, 3, dtype=torch.float64) * 0.1
    radius = torch.full((50, 3), 0.07, dtype=torch.float64)
    found = radial_distance(points, radius, torch.full_like(radius, 2.0))
    assert torch.allclose(found, points.norm(dim=-1) - 0.07, atol=2e-6)


@pytest.mark.parametrize("seed", range(4))
def test_sign_and_zeros_are_those_of_the_exact_distance_and_it_is_never_nearer_to_zero(seed):
    random = np.random.default_rng(seed)
    grid = GridSpec(48, 0.6, (-0.3, -0.3, -0.3), 60.0)
    axes = torch.tensor(random.uniform(0.03, 0.15, (1, 1, 3)), dtype=torch.float32)
    exponents = torch.tensor(random.uniform(2, 60, (1, 1, 3)), dtype=torch.float32)
    scene = SceneParameters(
        axes, exponents, torch.eye(3)[None, None], torch.zeros(1, 1, 3), torch.ones(1, 1) > 0
    )
    exact = scene_volumes(scene, grid).tsdf[0, 0].flatten()
    points = torch.from_numpy(grid.centres().reshape(-1, 3)).float()
    found = radial_distance(points, axes[0].expand_as(points), exponents[0].expand_as(points))
    clear = exact.abs() > 1e-4
    assert (found.sign() == exact.sign())[clear].all()
    assert (found.abs() > exact.abs() - 3e-4).all()
    reach = axes.norm() / axes.min()  # a ray meets a flat side at an angle
    assert (found.abs() <= exact.abs() * (1 + reach) + 1e-3)[exact > 0].all()


def test_gradients_are_those_of_finite_differences():
    given = [one.requires_grad_() for one in solids(12)]
    assert torch.autograd.gradcheck(
        lambda *values: radial_distance(*values, steps=12), given, eps=1e-7, atol=1e-5
    )


def test_nothing_is_infinite_in_the_centre_far_away_or_at_the_bounds():
    points = torch.tensor([[0.0, 0, 0], [1e-8, 0, 0], [5.0, -5, 5], [0.0, 0, 0.3]])
    for axis in (0.008, 0.45):
        for exponent in (1.1, 100.0):
            half_axes = torch.full((4, 3), axis, requires_grad=True)
            exponents = torch.full((4, 3), exponent, requires_grad=True)
            places = points.clone().requires_grad_()
            found = radial_distance(places, half_axes, exponents)
            found.sum().backward()
            for one in (found, half_axes.grad, exponents.grad, places.grad):
                assert torch.isfinite(one).all()
            assert (found[:2] < 0).all()


def test_all_24_descriptions_have_the_same():
    points, half_axes, exponents = solids(30)
    turn = torch.linalg.qr(torch.randn(30, 3, 3, dtype=torch.float64))[0]
    turn = turn * torch.linalg.det(turn)[:, None, None]
    middle = torch.randn(30, 3, dtype=torch.float64) * 0.1
    first = radial_distance(in_frame(points[:, None], turn, middle)[:, 0], half_axes, exponents)
    for way in equal_descriptions().double():
        order = way.abs().T
        local = in_frame(points[:, None], turn @ way, middle)[:, 0]
        again = radial_distance(local, half_axes @ order.T, exponents @ order.T)
        assert torch.allclose(again, first, atol=1e-9)
