"""Crops of stored and of rendered maps, in batches and one by one."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.data.rectangles import COLOURS, HEIGHTS, Rectangles

from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightGrid
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_tabletops.data import map_crops
from scenefw_tabletops.data.light import ColourJitter
from scenefw_tabletops.data.map_crops import MapCrops, RenderedMaps, StoredMaps
from scenefw_tabletops.data.table_scenes import TabletopScenes
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels

CPU = torch.device("cpu")


def crops(maps=None, **options):
    options = {"crops": 3, "size": (24, 16), "jitter": ColourJitter(), **options}
    return MapCrops(maps or StoredMaps(Rectangles()), **options)


def batch(made, indices, epoch):
    return made.batch(np.array(indices), epoch, CPU)


def same(first, second, at=slice(None)):
    return (
        torch.equal(first.labels[at], second.labels)
        and torch.equal(first.distance[at].nan_to_num(-1), second.distance.nan_to_num(-1))
        and torch.allclose(first.colour[at], second.colour, atol=1e-6)
    )


def test_a_sample_depends_on_seed_epoch_and_index_alone():
    options = {"height_noise": 0.001, "unseen": 0.5}
    several = batch(crops(**options), [1, 4, 5], 2)
    assert same(several, batch(crops(**options), [4], 2), slice(1, 2))
    assert not same(several, batch(crops(**options), [4], 3), slice(1, 2))
    assert not same(several, batch(crops(**options), [3], 2), slice(1, 2))
    assert not same(several, batch(crops(seed=1, **options), [4], 2), slice(1, 2))
    assert same(batch(crops(), [4, 0], None), batch(crops(), [4], None), slice(0, 1))


@given(st.integers(0, 5), st.integers(0, 100))
def test_a_crop_shows_one_place_of_the_map(index, epoch):
    """Colour, height and labels are cut and flipped alike: each pixel has its class's of both."""
    found = batch(crops(jitter=None), [index], epoch)
    assert found.labels.shape == (1, 16, 24)
    labels = found.labels[0].numpy()
    np.testing.assert_array_equal(found.distance[0, 0], HEIGHTS[labels])
    colour = (found.colour[0] * 255).permute(1, 2, 0).numpy()
    assert np.abs(colour - COLOURS[labels]).max() <= 15.01


def test_crops_come_from_everywhere_and_are_flipped():
    """A map whose heights tell the place of each vertex."""
    source = Rectangles(1)
    row, column = np.mgrid[:65, :65].astype(np.float32)

    def ramp(scene):
        return replace(source.truth(scene), heights=100 * row + column)

    made = crops(StoredMaps(source, ramp), crops=200, jitter=None)
    found = batch(made, np.arange(200), 0).distance[:, 0].numpy()
    rows, columns = found // 100, found % 100
    assert {rows.min(), columns.min()} == {0}
    assert {rows.max(), columns.max()} == {64}
    for along in (rows[:, 1, 0] - rows[:, 0, 0], columns[:, 0, 1] - columns[:, 0, 0]):
        assert set(along) == {-1, 1}
        assert 0.35 < (along > 0).mean() < 0.65
    unflipped = batch(crops(StoredMaps(source, ramp), flips=False, jitter=None), [0], 0).distance
    assert (unflipped[0, 0, 1:] > unflipped[0, 0, :-1]).all()


def test_noise_of_heights():
    clean, noisy = (batch(crops(height_noise=s, jitter=None), range(6), 0) for s in (0, 0.002))
    away = noisy.distance - clean.distance
    assert away.std() == pytest.approx(0.002, rel=0.05)
    assert abs(away.mean()) < 2e-4
    assert torch.equal(clean.labels, noisy.labels)


def test_a_line_cuts_off_what_is_unseen():
    made = crops(unseen=1.0, flips=False, crops=10)
    found = batch(made, range(20), 1)
    hidden = torch.isnan(found.distance[:, 0])
    assert 0.2 < hidden.float().mean() < 0.8
    assert torch.equal(hidden, found.labels == -1)
    assert not found.colour.permute(0, 2, 3, 1)[hidden].any()
    assert found.colour.permute(0, 2, 3, 1)[~hidden].any(dim=-1).all()
    assert not torch.isnan(batch(made, [0], None).distance).any()
    some = batch(crops(unseen=0.3, crops=100), range(200), 1).distance
    assert 0.15 < torch.isnan(some).any(dim=-1).any(dim=-1).float().mean() < 0.4


def test_fused_maps_take_the_place_of_the_truth():
    source = Rectangles()

    def fused(scene):
        truth = source.truth(scene)
        heights = truth.heights + np.float32(0.5)
        heights[:, :40] = np.nan
        return replace(truth, heights=heights, labels=None)

    found = batch(crops(StoredMaps(source, fused), size=(65, 65)), [0], None)
    assert (found.labels[0, :, :40] == -1).all()
    assert torch.isnan(found.distance[0, 0, :, :40]).all()
    truth = source.truth(0)
    np.testing.assert_array_equal(found.labels[0, :, 40:], truth.labels[:, 40:])
    np.testing.assert_allclose(found.distance[0, 0, :, 40:], truth.heights[:, 40:] + 0.5)
    small = Rectangles(vertices=33)
    with pytest.raises(ConfigError, match="one grid"):
        batch(crops(StoredMaps(source, small.truth)), [0], None)


def test_rendered_maps_are_those_of_the_renderer():
    generator = TabletopGenerator(ProceduralModels())
    source = TabletopScenes(generator, MeshRaycaster(), limit=2, vertices=129)
    found = RenderedMaps(source, workers=1).load(CPU)
    for scene in range(2):
        truth = source.truth(scene)
        np.testing.assert_array_equal(found.colour[scene], truth.colour)
        np.testing.assert_array_equal(found.labels[scene], truth.labels)
        np.testing.assert_allclose(found.heights[scene], truth.heights, atol=1e-6)
    assert len(found.labels.unique()) >= 3


def test_a_map_is_fetched_once():
    source = Rectangles()
    made = crops(StoredMaps(source))
    made.prepare(CPU)
    batch(made, range(6), 0)
    assert source.fetched == 2


def test_the_grid_of_the_fake_source_is_one():
    assert Rectangles().truth(0).grid == HeightGrid(65, extent=0.064)


@pytest.mark.parametrize(
    "wrong", [{"crops": 0}, {"size": (0, 16)}, {"height_noise": -0.001}, {"unseen": 1.5}]
)
def test_settings_of_crops_are_checked(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        MapCrops(StoredMaps(Rectangles()), **wrong)


def test_kernels_of_noise_meet_no_nan(monkeypatch):
    """Their fast maths takes for granted that there is none."""
    seen = []

    def checked(count, heights, *others):
        seen.append(bool(heights.isfinite().all()))
        add_noise(count, heights, *others)

    add_noise = map_crops.add_noise
    monkeypatch.setattr(map_crops, "add_noise", checked)
    source = Rectangles()

    def fused(scene):
        truth = source.truth(scene)
        truth.heights[::3] = np.nan
        return truth

    found = batch(crops(StoredMaps(source, fused), height_noise=0.002, jitter=None), range(6), 0)
    assert seen == [True]
    assert torch.equal(found.distance[:, 0].isnan(), found.labels == -1)
    assert found.distance.isnan().any()
