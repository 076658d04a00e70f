from types import SimpleNamespace

import pytest
import torch

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec, PartialTSDF, ShapeInstancePrediction
from scenefw.perception.reconstruction import NetworkReconstructor


class Echo(torch.nn.Module):
    """A network whose TSDF is its condition plus the first entry of the code."""

    latent_size = 4

    def predict(self, condition, latent=None):
        shift = latent[:, :1, None, None, None]
        votes = condition[:, :1].expand(-1, 3, -1, -1, -1)
        return ShapeInstancePrediction(condition[:, :1] + shift, votes)


class Signs:
    """One instance: the inside."""

    def extract(self, tsdf, votes, grid):
        return (tsdf < 0).int(), torch.zeros(1, 3)


def make(resolution, observed=False):
    grid = GridSpec(resolution=resolution)
    checkpoint = SimpleNamespace(model=Echo(), grid=grid, observed=observed, metadata={})
    distance = grid.truncation * (2 * torch.rand(2, 1, *grid.shape) - 1)
    return NetworkReconstructor(checkpoint, Signs()), grid, PartialTSDF(distance, distance > 0)


@pytest.mark.parametrize("observed", [False, True])
@pytest.mark.parametrize("resolution", [8, 16])
def test_first_sample_is_the_zero_code_and_distances_are_metres(resolution, observed):
    method, grid, partial = make(resolution, observed)
    samples = method.reconstruct(partial, grid, 3, torch.Generator().manual_seed(0))
    assert len(samples) == 3
    torch.testing.assert_close(samples[0][0], partial.distance[:, 0])
    for tsdf, instances in samples:
        assert tsdf.shape == instances.shape == (2, *grid.shape)
        assert instances.dtype == torch.int32
        assert tsdf.abs().max() <= grid.truncation * 1.0001
        assert ((instances > 0) == (tsdf < 0)).all()
    assert not torch.equal(samples[1][0], samples[2][0])


def test_codes_come_from_the_generator():
    method, grid, partial = make(8)
    runs = [method.volumes(partial, grid, 2, torch.Generator().manual_seed(s)) for s in (1, 1, 2)]
    assert torch.equal(runs[0][1][0], runs[1][1][0])
    assert not torch.equal(runs[0][1][0], runs[2][1][0])


def test_another_grid_is_one_line():
    method, _, _ = make(8)
    other = GridSpec(resolution=16)
    volume = torch.zeros(1, 1, *other.shape)
    with pytest.raises(InputError, match="was trained on"):
        method.volumes(PartialTSDF(volume, volume > 0), other, 1, torch.Generator())
