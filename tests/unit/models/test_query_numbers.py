"""Superquadrics as numbers, there and back, and with noise."""

import pytest
import torch
from tests.unit.models.queries import scenes_of

from scenefw.core.batches import SceneParameters
from scenefw.models.query_numbers import SIZE, noised, numbers_of, parameters_of
from scenefw.shapes.radial_distance import in_frame, radial_distance


def distances(positions, rotations, half_axes, exponents, places):
    local = in_frame(places, rotations, positions)
    axes, powers = (one[..., None, :].expand_as(local) for one in (half_axes, exponents))
    return radial_distance(local, axes, powers)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_numbers_tell_the_same_solids(seed):
    """Whatever of the 24 descriptions was taken: signed distances are those of before."""
    scenes = scenes_of(3, 4, seed)
    found = parameters_of(numbers_of(scenes), scenes.positions)
    places = scenes.positions[:, :, None] + 0.2 * (torch.rand(3, 4, 50, 3) - 0.5)
    true = (scenes.positions, scenes.rotations, scenes.half_axes, scenes.exponents)
    assert torch.allclose(distances(*found, places), distances(*true, places), atol=2e-5)
    traces = found[1].diagonal(dim1=-2, dim2=-1).sum(dim=-1)
    assert (traces >= scenes.rotations.diagonal(dim1=-2, dim2=-1).sum(dim=-1) - 1e-5).all()
    assert (traces > 1.4).all()  # no turn is further than 62.8 degrees from one of the 24


def test_what_lies_beyond_the_bounds_stays_finite():
    scenes = scenes_of()
    wild = SceneParameters(
        scenes.half_axes * torch.tensor([1e-3, 1.0, 30.0]),
        scenes.exponents * torch.tensor([0.01, 1.0, 100.0]),
        scenes.rotations, scenes.positions, scenes.present,
    )  # fmt: skip
    numbers = numbers_of(wild)
    assert numbers.shape[-1] == SIZE
    assert torch.isfinite(numbers).all()
    assert all(torch.isfinite(one).all() for one in parameters_of(numbers, wild.positions))


def test_absent_objects_stay_finite_and_stand_for_nothing():
    scenes = scenes_of()
    empty = SceneParameters(
        *(torch.zeros_like(one) for one in (scenes.half_axes, scenes.exponents, scenes.rotations,
                                            scenes.positions, scenes.present)),
    )  # fmt: skip
    start = noised(empty, 1, torch.Generator().manual_seed(0))
    assert torch.isfinite(start.numbers).all()
    assert not start.active.any()
    assert (start.objects == -1).all()


def test_noise_is_that_of_its_generator():
    scenes = scenes_of()
    one, same, other = (
        noised(scenes, 2, torch.Generator().manual_seed(seed)) for seed in (1, 1, 2)
    )
    assert torch.equal(one.starts, same.starts)
    assert torch.equal(one.numbers, same.numbers)
    assert not torch.allclose(one.starts, other.starts)
