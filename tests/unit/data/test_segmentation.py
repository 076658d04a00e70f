from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.data.rectangles import COLOURS, HEIGHTS, Rectangles

from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightGrid
from scenefw.data.modules import IndexBatch
from scenefw.data.segmentation import (
    ColourJitter,
    MapCrops,
    SegmentationData,
    ViewSamples,
    image_tensor,
)
from scenefw.noise.gaussian import Gaussian


def same(first, second):
    arrays = [(vars(first)[k], vars(second)[k]) for k in ("colour", "distance", "labels")]
    return all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f") for a, b in arrays)


def views(source=None, **options):
    options = {
        "views": 3,
        "noise": {"gaussian": Gaussian(0.001)},
        "jitter": ColourJitter(),
        **options,
    }
    return ViewSamples(source or Rectangles(), **options)


def crops(source=None, **options):
    options = {"crops": 3, "size": (24, 16), "jitter": ColourJitter(), **options}
    return MapCrops(source or Rectangles(), **options)


@pytest.mark.parametrize("make", [views, crops])
def test_a_sample_depends_on_seed_epoch_and_index_alone(make):
    first = make().sample(4, 2)
    again = make()
    again.sample(1, 0)
    assert same(first, again.sample(4, 2))
    assert not same(first, again.sample(4, 3))
    assert not same(first, again.sample(3, 2))
    assert not same(first, make(seed=1).sample(4, 2))
    assert same(again.sample(4, None), make().sample(4, None))


def test_a_view_is_that_of_the_source():
    source = Rectangles()
    frame = next(source.frames(1, 1, 2))
    found = views(source).sample(5, None)
    np.testing.assert_array_equal(found.colour, frame.colour)
    np.testing.assert_array_equal(found.labels, frame.labels)
    assert np.isnan(found.distance[0, 0])
    np.testing.assert_array_equal(found.distance.ravel()[1:], frame.depth.ravel()[1:])


def test_noise_keeps_holes_and_labels():
    clean, noisy = views().sample(0, None), views().sample(0, 0)
    np.testing.assert_array_equal(np.isnan(clean.distance), np.isnan(noisy.distance))
    np.testing.assert_array_equal(clean.labels, noisy.labels)
    assert 5e-4 < np.nanstd(noisy.distance - clean.distance) < 2e-3


@given(st.integers(0, 5), st.integers(0, 100))
def test_a_crop_shows_one_place_of_the_map(index, epoch):
    """Colour, height and labels are cut and flipped alike: each pixel has its class's of both."""
    found = crops(jitter=None).sample(index, epoch)
    assert found.labels.shape == (16, 24)
    np.testing.assert_array_equal(found.distance, HEIGHTS[found.labels])
    assert np.abs(found.colour.astype(int) - COLOURS[found.labels]).max() <= 15


def test_a_line_cuts_off_what_is_unseen():
    found = [crops(unseen=1.0, flips=False).sample(0, epoch) for epoch in range(20)]
    shares = [np.isnan(f.distance).mean() for f in found]
    assert 0.2 < np.mean(shares) < 0.8
    for one in found:
        hidden = np.isnan(one.distance)
        np.testing.assert_array_equal(hidden, one.labels == -1)
        assert not one.colour[hidden].any()
        assert one.colour[~hidden].any(axis=-1).all()
    assert not np.isnan(crops(unseen=1.0).sample(0, None).distance).any()


def test_fused_maps_take_the_place_of_the_truth():
    source = Rectangles()

    def fused(scene):
        truth = source.truth(scene)
        heights = truth.heights + np.float32(0.5)
        heights[:, :40] = np.nan
        return replace(truth, heights=heights, labels=None)

    found = crops(source, maps=fused, size=(65, 65)).sample(0, None)
    assert (found.labels[:, :40] == -1).all()
    assert np.isnan(found.distance[:, :40]).all()
    np.testing.assert_array_equal(found.labels[:, 40:], source.truth(0).labels[:, 40:])
    np.testing.assert_allclose(found.distance[:, 40:], source.truth(0).heights[:, 40:] + 0.5)
    small = Rectangles(vertices=33)
    with pytest.raises(ConfigError, match="one grid"):
        crops(source, maps=small.truth).sample(0, None)


@pytest.mark.parametrize(("make", "fetches"), [(views, 6), (crops, 2)])
def test_all_is_fetched_before_a_training_and_once(make, fetches):
    source = Rectangles()
    data = SegmentationData(make(source), make())
    data.setup("fit")
    assert source.fetched == fetches
    found = [data.train.sample(index, 3) for index in range(6)]
    assert source.fetched == fetches
    assert all(same(sample, make().sample(i, 3)) for i, sample in enumerate(found))


def test_memory_is_bounded():
    """A view of 48 x 40 takes 15 kB as kept: room for two, the others are fetched each time."""
    source = Rectangles()
    samples = views(source, memory=0.035)
    assert not samples.fetch(0)
    assert source.fetched == 3
    for index in range(6):
        assert same(samples.sample(index, 0), views().sample(index, 0))
    assert source.fetched == 3 + 4


def test_jitter_of_nothing_changes_nothing():
    image = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    rng = np.random.default_rng(0)
    np.testing.assert_allclose(ColourJitter(0, 0, 0).apply(image, rng), image, atol=1)
    bright = ColourJitter(0.5, 0.5, 0.1).apply(image, rng)
    assert bright.dtype == np.uint8
    assert not np.array_equal(bright, image)
    with pytest.raises(ConfigError, match="jitter"):
        ColourJitter(brightness=1.0)


def test_batches_are_the_samples():
    data = SegmentationData(views(), crops(size=(48, 40)), batch_size=2)
    assert data.classes == ("surface", "red", "blue")
    assert len(data.train_dataloader()) == 3
    batch = data.training_batch(IndexBatch(1, torch.tensor([2, 5])), torch.device("cpu"))
    assert batch.colour.shape == (2, 3, 40, 48)
    assert batch.distance.shape == (2, 1, 40, 48)
    sample = data.train.sample(5, 1)
    assert torch.equal(batch.colour[1], image_tensor(sample.colour))
    np.testing.assert_array_equal(batch.labels[1], sample.labels)
    assert batch.labels.dtype == torch.int64
    held_out = data.validation_batch(IndexBatch(7, torch.tensor([0])), torch.device("cpu"))
    np.testing.assert_array_equal(held_out.labels[0], data.validation.sample(0, None).labels)
    assert data.facts()["input"] == "views"


def test_two_splits_have_the_same_classes():
    other = Rectangles()
    other.classes = ("surface", "red", "green")
    with pytest.raises(ConfigError, match="green"):
        SegmentationData(views(), views(other))


def test_a_source_without_labels_is_refused():
    class Unlabelled(Rectangles):
        def frames(self, scene, count, start=0):
            return (replace(f, labels=None) for f in super().frames(scene, count, start))

    with pytest.raises(ConfigError, match="rectangles/0/0 has no labels"):
        views(Unlabelled()).sample(0, None)


def test_the_grid_of_the_fake_source_is_one():
    assert Rectangles().truth(0).grid == HeightGrid(65, extent=0.064)
