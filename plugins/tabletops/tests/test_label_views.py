"""Stored and rendered views, in batches and one by one."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.data.rectangles import Rectangles

from scenefw.core.errors import ConfigError
from scenefw.labelling.network_inputs import distance_image, image_tensor
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.kinect import Kinect
from scenefw.noise.pose import Jitter
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw.renderers.tables import Pictures
from scenefw_tabletops.data.label_views import RenderedViews, StoredViews, ViewSamples
from scenefw_tabletops.data.light import ColourJitter
from scenefw_tabletops.data.table_scenes import TabletopScenes
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels

CPU = torch.device("cpu")
GENERATOR = TabletopGenerator(ProceduralModels())


def tables(size=(64, 48)):
    return TabletopScenes(GENERATOR, MeshRaycaster(), limit=3, size=size)


RENDERED = RenderedViews(tables(), 4, workers=1)


def samples(images, **options):
    options = {
        "noise": {"gaussian": Gaussian(0.001)},
        "jitter": ColourJitter(),
        "geometry": "depth",
    } | options
    return ViewSamples(images, **options)


def stored(source=None, memory=1500.0):
    return StoredViews(source or Rectangles(), 3, memory)


def batch(views, indices, epoch):
    return views.batch(np.array(indices), epoch, CPU)


def same(first, second, at=slice(None)):
    """Light is of a mean over pixels, which rounds otherwise in another batch."""
    return (
        torch.equal(first.labels[at], second.labels)
        and torch.equal(first.distance[at].nan_to_num(-1), second.distance.nan_to_num(-1))
        and torch.allclose(first.colour[at], second.colour, atol=1e-6)
    )


@pytest.mark.parametrize("images", [stored(), RENDERED], ids=["stored", "rendered"])
def test_a_sample_depends_on_seed_epoch_and_index_alone(images):
    made = samples(images)
    several = batch(made, [1, 4, 5], 2)
    assert same(several, batch(samples(images), [4], 2), slice(1, 2))
    assert not same(several, batch(made, [4], 3), slice(1, 2))
    assert not same(several, batch(made, [3], 2), slice(1, 2))
    assert not same(several, batch(samples(images, seed=1), [4], 2), slice(1, 2))
    assert same(batch(made, [0, 4], None), batch(samples(images), [4], None), slice(1, 2))


def test_a_stored_view_is_that_of_the_source():
    source = Rectangles()
    frame = next(source.frames(1, 1, 2))
    found = batch(samples(stored(source)), [5], None)
    assert torch.equal(found.colour[0], image_tensor(frame.colour))
    np.testing.assert_array_equal(found.labels[0], frame.labels)
    assert torch.isnan(found.distance[0, 0, 0, 0])
    np.testing.assert_array_equal(found.distance[0, 0].ravel()[1:], frame.depth.ravel()[1:])


@pytest.mark.parametrize("size", [(64, 48), (96, 80)])
def test_a_rendered_batch_is_what_the_renderer_makes_of_each(size):
    source = tables(size)
    made = ViewSamples(RenderedViews(source, 4, workers=1), geometry="height")
    indices = [9, 0, 2, 11]
    found = batch(made, indices, None)
    for row, index in enumerate(indices):
        scene, view = divmod(index, 4)
        camera = source.camera(scene, view)
        geometry = source.scenes.geometry(source.scene(scene))
        frame = next(MeshRaycaster().frames(geometry, [camera]))
        np.testing.assert_array_equal(found.labels[row], frame.labels)
        height = distance_image(frame, "height")
        np.testing.assert_allclose(found.distance[row, 0], height, atol=1e-5)
        away = (found.colour[row] - image_tensor(frame.colour)).abs().max()
        assert away <= 0.51 / 255
    assert len(found.labels.unique()) >= 3


def test_views_are_renewed_a_part_in_every_epoch():
    """Kept views are those that a training which starts later renders, whatever the order."""
    source = tables()
    plain = {"noise": {}, "jitter": None}
    kept = samples(RenderedViews(source, 4, renew=3, workers=1), **plain)
    found = [batch(kept, np.arange(12), epoch) for epoch in range(5)]
    for epoch in range(4):
        same_view = [
            torch.equal(found[epoch].distance[i], found[epoch + 1].distance[i]) for i in range(12)
        ]
        assert same_view == [(epoch + 1 + i) % 3 != 0 for i in range(12)]
    later = samples(RenderedViews(source, 4, renew=3, workers=1), **plain)
    order = [7, 2, 11]
    assert same(batch(later, order, 4), batch(kept, order, 4))
    at_once = samples(RenderedViews(source, 4, workers=1), **plain)
    assert not same(batch(at_once, order, 4), batch(kept, order, 4))
    with pytest.raises(ConfigError, match="renew = 0"):
        RenderedViews(source, renew=0)


def test_rendered_cameras_are_new_in_every_epoch_and_drawn_as_the_sources():
    found = [
        batch(ViewSamples(RENDERED, geometry="depth"), np.arange(12), epoch) for epoch in range(10)
    ]
    depth = torch.cat([b.distance[:, 0] for b in found])
    assert not torch.isnan(depth).any()
    own = torch.cat([batch(ViewSamples(RENDERED, geometry="depth"), np.arange(12), None).distance])
    assert not any(torch.equal(own, b.distance) for b in found)
    nearest, farthest = depth.amin(dim=(1, 2)), depth.amax(dim=(1, 2))
    assert nearest.min() > 0.18 - 0.09
    assert farthest.max() < 1.5
    assert len(np.unique(nearest)) > 115
    # Height of the camera: z-depth of the table at the middle is height / cos(angle)
    middle = depth[:, 24, 32]
    assert 0.26 < middle.mean() < 0.36
    assert 0.04 < middle.std() < 0.1


def test_drawn_poses_have_the_sources_spread():
    source = tables()
    drawn = source.poses(np.random.default_rng(0).random((4000, source.DRAWS)))
    own = np.stack([source.camera(s, v).T_world_camera for s in range(3) for v in range(200)])
    for poses, count in ((drawn, 4000), (own, 600)):
        height, ahead = poses[:, 2, 3], poses[:, :3, 2]
        angle = np.rad2deg(np.arccos(-ahead[:, 2]))
        target = poses[:, :3, 3] - ahead * (height / ahead[:, 2])[:, None]
        spread = 3.5 / np.sqrt(count)
        assert height.min() >= 0.18
        assert height.max() <= 0.40
        assert abs(height.mean() - 0.29) < spread * 0.22 / np.sqrt(12)
        assert angle.max() <= 40 + 1e-6
        assert abs(angle.mean() - 20) < spread * 40 / np.sqrt(12)
        assert np.abs(target[:, :2]).max() <= 0.5 + 1e-9
        assert np.abs(target[:, :2].mean(axis=0)).max() < spread / np.sqrt(12)
        assert np.abs(ahead[:, :2].mean(axis=0)).max() < 0.4 * spread
        rotation = poses[:, :3, :3]
        np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1), np.eye(3)[None].repeat(
            count, axis=0), atol=1e-12)  # fmt: skip


def test_noise_keeps_holes_and_labels_and_has_its_size():
    clean = batch(samples(stored()), [0, 1], None)
    noisy = batch(samples(stored(), jitter=None), [0, 1], 0)
    assert torch.equal(torch.isnan(clean.distance), torch.isnan(noisy.distance))
    assert torch.equal(clean.labels, noisy.labels)
    assert torch.equal(clean.colour, noisy.colour)
    away = (noisy.distance - clean.distance).nan_to_num(0.0)
    assert away.std() == pytest.approx(1e-3, rel=0.05)
    assert abs(away.mean()) < 1e-4
    assert abs(np.corrcoef(away[0].ravel(), away[1].ravel())[0, 1]) < 0.1


def test_noises_work_on_rendered_batches_in_the_order_of_their_names():
    kinect = Kinect(nearest=0.1, disparity_step=0.03)
    both = samples(RENDERED, noise={"b": Gaussian(0.001), "a": kinect}, jitter=None)
    found, clean = (
        batch(both, [3, 7], 1),
        batch(samples(RENDERED, noise={}, jitter=None), [3, 7], 1),
    )
    assert torch.equal(found.colour, clean.colour)
    lost = torch.isnan(found.distance)
    assert 0.001 < lost.float().mean() < 0.5
    away = (found.distance - clean.distance)[~lost].abs()
    assert 2e-4 < away.median() < 5e-3


def test_noise_of_poses_lifts_and_tilts_heights_and_leaves_depth():
    source = Rectangles(scenes=100)
    indices = np.arange(300)

    def away(noise, geometry="height"):
        options = {"jitter": None, "geometry": geometry}
        noisy = batch(samples(stored(source), noise=noise, **options), indices, 0)
        clean = batch(samples(stored(source), noise={}, **options), indices, 0)
        assert torch.equal(noisy.labels, clean.labels)
        return (noisy.distance - clean.distance)[:, 0, 1:]  # row 0 has a hole

    lifts = away({"pose": Jitter(0.002, rotation=0.0)})
    assert lifts.flatten(1).std(dim=1).max() < 1e-6
    assert lifts.mean(dim=(1, 2)).std() == pytest.approx(0.002, rel=0.15)
    tilts = away({"pose": Jitter(0.002, rotation=0.01)})
    # A turn about the optical axis leaves heights, one about x lifts a row in proportion to y
    assert (tilts - lifts).flatten(1).std(dim=1).min() > 1e-5
    assert not away({"pose": Jitter(0.002)}, "depth").any()
    two = away({"a": Jitter(0.002, rotation=0.0), "b": Jitter(0.002, rotation=0.0)})
    assert two.mean(dim=(1, 2)).std() == pytest.approx(0.002 * np.sqrt(2), rel=0.15)


def test_all_is_fetched_before_a_training_and_once():
    source = Rectangles()
    images = stored(source)
    images.prepare(CPU)
    assert source.fetched == 6
    batch(samples(images), range(6), 3)
    assert source.fetched == 6


def test_memory_is_bounded():
    """A view of 48 x 40 takes 15 kB as kept: room for two, the others are fetched each time."""
    source = Rectangles()
    images = stored(source, memory=0.035)
    images.prepare(CPU)
    assert source.fetched == 3
    assert same(batch(samples(images), range(6), 0), batch(samples(stored()), range(6), 0))
    assert source.fetched == 3 + 4


def test_a_source_without_labels_is_refused():
    class Unlabelled(Rectangles):
        def frames(self, scene, count, start=0):
            return (replace(f, labels=None) for f in super().frames(scene, count, start))

    with pytest.raises(ConfigError, match="rectangles/0/0 has no labels"):
        batch(samples(stored(Unlabelled())), [0], None)


def test_another_renderer_makes_no_batches():
    source = tables()
    source.renderer = object()
    with pytest.raises(ConfigError, match="object renders no batches"):
        RenderedViews(source)
    with pytest.raises(ConfigError, match="workers = 0"):
        RenderedViews(tables(), workers=0)


def test_kept_views_are_rendered_again_on_another_device():
    """Those of a device that is gone are lost, and one device may have two names."""
    views = RenderedViews(tables(), 4, renew=3, workers=1)
    every = np.arange(12)
    first = views.render(every, 0, CPU)
    elsewhere = (first.depth, first.labels, first.colour)
    views._cached = Pictures(*(one.to("meta") for one in elsewhere))
    for device in (CPU, torch.device("cpu:0"), torch.device("cpu:0")):
        again = views.render(every, 0, device)
        assert torch.equal(first.labels, again.labels)
        assert torch.equal(first.colour, again.colour)
