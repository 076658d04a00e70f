from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter
from scipy.stats import kstest

from scenefw.core.batches import PartialTSDF, ShapeInstancePrediction
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.perception.completion.volume_network import (
    VolumeNetwork,
    coupled_codes,
    smoothed,
)
from scenefw.perception.observation.observation import Observation
from scenefw.perception.steps import Fits, Objects
from scenefw.representations.occupancy import Occupancy


class Echo(torch.nn.Module):
    """A network whose TSDF is its condition plus the first entry of the code."""

    def __init__(self, latent_size=4):
        super().__init__()
        self.latent_size, self.outputs = latent_size, {"tsdf": 1, "votes": 3}

    def predict(self, condition, latent=None):
        shift = latent[:, :1, None, None, None] if self.latent_size else 0
        if latent is not None:
            condition = condition.repeat(len(latent) // len(condition), 1, 1, 1, 1)
        votes = condition[:, :1].expand(-1, 3, -1, -1, -1)
        return ShapeInstancePrediction({"tsdf": condition[:, :1] + shift, "votes": votes})


class Signs:
    """One instance: the inside."""

    def extract(self, tsdf, votes, grid):
        return (tsdf < 0).int(), torch.zeros(1, 3)


def make(resolution, smoothing=0.0, **options):
    grid = GridSpec(resolution=resolution)
    checkpoint = SimpleNamespace(model=Echo(), grid=grid, metadata={})
    distance = grid.truncation * (2 * torch.rand(2, 1, *grid.shape) - 1)
    return (
        VolumeNetwork(checkpoint, Signs(), smoothing=smoothing, **options),
        grid,
        PartialTSDF(distance, distance > 0),
    )


def scenes_of(method, partial, samples, seed=0):
    """What a method says of the first of some views."""
    first = PartialTSDF(partial.distance[:1], partial.observed[:1])
    view, generator = Observation(None, first, method.grid), torch.Generator().manual_seed(seed)
    sets = method.complete(Fits(Objects(None)), view, samples, generator)
    assert all(each.superquadrics is None for each in sets)
    return [each.objects for each in sets]


@pytest.mark.parametrize("resolution", [8, 16])
def test_first_sample_is_the_zero_code_and_distances_are_metres(resolution):
    method, grid, partial = make(resolution)
    samples = scenes_of(method, partial, 3)
    assert len(samples) == 3
    np.testing.assert_allclose(samples[0].tsdf, partial.distance[0, 0], rtol=1e-5, atol=1e-7)
    for one in samples:
        assert one.tsdf.shape == one.instances.shape == grid.shape
        assert (one.tsdf.dtype, one.instances.dtype) == (np.float32, np.int32)
        assert np.abs(one.tsdf).max() <= grid.truncation * 1.0001
        assert ((one.instances > 0) == (one.tsdf < 0)).all()
        assert one.masks is None
        assert one.volumes["votes"].shape == (1, 3, *grid.shape)
    assert not np.array_equal(samples[1].tsdf, samples[2].tsdf)


def test_codes_of_several_views_are_decoded_together():
    method, grid, partial = make(8)
    codes = torch.tensor([0.0, 5.0])[:, None, None].expand(2, 2, 4)
    zero, high = method.complete_with(partial, grid, codes)
    torch.testing.assert_close(zero.tsdf, partial.distance[:, 0])
    torch.testing.assert_close(high.tsdf, torch.full_like(zero.tsdf, grid.truncation))
    assert not high.instances.any()


def test_the_most_typical_scene_needs_no_fits_and_no_segments():
    method, grid, partial = make(8)
    first = scenes_of(method, partial, 3)[0]
    view = Observation(None, PartialTSDF(partial.distance[:1], partial.observed[:1]), grid)
    segments = np.ones((4, 5), np.int32)
    for objects in (method.typical(view), method.group(segments, view)):
        np.testing.assert_array_equal(objects.tsdf, first.tsdf)
        np.testing.assert_array_equal(objects.instances, first.instances)


def test_codes_come_from_the_generator():
    method, grid, partial = make(8)
    runs = [method.volumes(partial, grid, 2, torch.Generator().manual_seed(s)) for s in (1, 1, 2)]
    first, again, other = (samples[1]["tsdf"] for samples in runs)
    assert torch.equal(first, again)
    assert not torch.equal(first, other)


def test_the_temperature_scales_drawn_codes_alone():
    grid = GridSpec(resolution=8)
    partial = PartialTSDF(torch.zeros(1, 1, *grid.shape), torch.ones(1, 1, *grid.shape, dtype=bool))

    def shifts(temperature):
        method, _, _ = make(8, temperature=temperature)
        found = method.volumes(partial, grid, 4, torch.Generator().manual_seed(5))
        return torch.stack([v["tsdf"][0, 0, 0, 0, 0] / grid.truncation for v in found])

    torch.testing.assert_close(shifts(0.2), 0.2 * shifts(0.4) / 0.4, atol=1e-6, rtol=1e-5)
    assert shifts(0.2)[1:].abs().min() > 0
    assert shifts(0.0).tolist() == [0.0]


def test_all_samples_can_be_drawn():
    grid = GridSpec(resolution=8)
    partial = PartialTSDF(torch.zeros(1, 1, *grid.shape), torch.ones(1, 1, *grid.shape, dtype=bool))
    method, _, _ = make(8, typical_first=False, temperature=0.1)
    found = method.volumes(partial, grid, 3, torch.Generator().manual_seed(5))
    shifts = torch.stack([v["tsdf"][0, 0, 0, 0, 0] for v in found]) / grid.truncation
    assert shifts.abs().min() > 0
    assert shifts.sum().abs() < 1e-6  # of coupled codes
    assert len(method.volumes(partial, grid, 1, torch.Generator())) == 1


@pytest.mark.parametrize("samples", [2, 3, 6])
def test_each_coupled_code_is_standard_normal(samples):
    codes = coupled_codes(samples, (4, 5000), torch.Generator().manual_seed(1)).double()
    for code in codes:
        assert kstest(code.flatten().numpy(), "norm").pvalue > 1e-3
    correlations = np.corrcoef(codes.flatten(1).numpy())
    apart = correlations[~np.eye(samples, dtype=bool)]
    np.testing.assert_allclose(apart, -1 / (samples - 1), atol=0.02)
    assert codes.sum(dim=0).abs().max() < 1e-5


def test_a_mean_over_coupled_codes_varies_less():
    def spread(codes):  # of the mean of something that isn't linear in the codes
        return (codes[..., 0] > 0.5).double().mean(dim=0).var()

    shape, generator = (20_000, 1), torch.Generator().manual_seed(2)
    alone = spread(torch.randn((3, *shape), generator=generator))
    assert spread(coupled_codes(3, shape, generator)) < 0.8 * alone


def test_a_single_coupled_code_is_a_draw():
    drawn = coupled_codes(1, (2, 3), torch.Generator().manual_seed(3))
    assert torch.equal(drawn, torch.randn((1, 2, 3), generator=torch.Generator().manual_seed(3)))
    assert coupled_codes(0, (2, 3), torch.Generator()).shape == (0, 2, 3)


@pytest.mark.parametrize("options", [{"temperature": -1.0}, {"smoothing": -1.0}])
def test_negative_settings_are_errors(options):
    with pytest.raises(ConfigError, match=next(iter(options))):
        make(8, **options)


def test_another_grid_is_one_line():
    method, _, _ = make(8)
    other = GridSpec(resolution=16)
    volume = torch.zeros(1, 1, *other.shape)
    with pytest.raises(InputError, match="was trained on"):
        method.volumes(PartialTSDF(volume, volume > 0), other, 1, torch.Generator())


@pytest.mark.parametrize("resolution", [8, 16])
@pytest.mark.parametrize("sigma", [0.4, 0.6, 1.5])
def test_smoothing_is_a_gaussian(resolution, sigma):
    volumes = torch.rand(2, 1, *(resolution,) * 3)
    radius = int(np.ceil(3 * sigma))
    for mine, given in zip(smoothed(volumes, sigma), volumes, strict=True):
        expected = gaussian_filter(given[0].numpy(), sigma, mode="nearest", radius=radius)
        np.testing.assert_allclose(mine[0].numpy(), expected, atol=1e-5)


def test_a_plane_stays_where_it_is():
    heights = torch.linspace(-1, 1, 16).expand(1, 1, 16, 16, 16)
    inner = slice(3, -3)
    mine = smoothed(heights, 0.6)
    torch.testing.assert_close(mine[..., inner], heights[..., inner].contiguous())
    assert smoothed(heights, 0.0) is heights


def test_distances_are_smoothed_before_instances_are_found():
    plain, grid, partial = make(16)
    method, _, _ = make(16, smoothing=0.6)
    raw = plain.volumes(partial, grid, 1, torch.Generator())[0]["tsdf"]
    tsdf = method.volumes(partial, grid, 1, torch.Generator())[0]["tsdf"]
    torch.testing.assert_close(tsdf, smoothed(raw, 0.6))


def test_a_network_without_codes_gives_one_sample():
    grid = GridSpec(resolution=8)
    checkpoint = SimpleNamespace(model=Echo(latent_size=0), grid=grid, metadata={})
    method = VolumeNetwork(checkpoint, Signs())
    partial = PartialTSDF(torch.zeros(2, 1, *grid.shape), torch.ones(2, 1, *grid.shape, dtype=bool))
    assert len(scenes_of(method, partial, 3)) == 1


def test_an_output_that_the_network_lacks_is_one_line():
    with pytest.raises(ConfigError, match="no output occupancy of 1 channels") as caught:
        make(8, representations={"occupancy": Occupancy()})
    assert "\n" not in str(caught.value)
