"""Stored images with colour and obstacles, beside views of superquadrics."""

import numpy as np
import pytest
import torch
from plugins.things.tests.images_folder import write
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.types import GridSpec
from scenefw.data.batches.part_views import PartViews
from scenefw.kernels.cameras import pixel_places
from scenefw.noise.gaussian import Gaussian
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.scenes.cameras import RandomViewpoints
from scenefw_things.images.part_images import PartImages
from scenefw_things.images.stored_images import DEPTH_UNIT, OBSTACLE, StoredImages

CPU = torch.device("cpu")
WIDTH, HEIGHT = 64, 48


@pytest.fixture
def made(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    write(tmp_path / "things/train", 6, (WIDTH, HEIGHT))
    write(tmp_path / "things/val", 3, (WIDTH, HEIGHT), 1)

    def data(
        colourless=0.0,
        brightness=0.0,
        mixing=0.0,
        scale=0.0,
        tilt=0.0,
        lift=0.0,
        noise=None,
        limit=None,
        crop=None,
    ):
        views = PartViews(
            RandomViewpoints(), SphereTracer(), GridSpec(64), str(tmp_path / "stacks.npz"),
            image_size=(WIDTH, HEIGHT), validation_limit=2, batch_size=4, traced=0.0,
            compound=0.0, ends=0.0, tilt=tilt, lift=lift, noise=noise,
        )  # fmt: skip
        folder = tmp_path / "things"
        return PartImages(views, folder, colourless, brightness, mixing, scale, limit, crop)

    return data


def batch_of(data, *rows, epoch=0):
    return data.training_batch(IndexBatch(epoch, torch.tensor(rows)), CPU)


def test_stored_images_come_back_some_of_them_in_a_mirror(made, tmp_path):
    stored, batch = StoredImages.open(tmp_path / "things/train"), batch_of(made(), *range(6))
    mirrored = []
    for row in range(6):
        depth, owners, colour = (stored.depth[row] * np.float32(DEPTH_UNIT), stored.owners[row],
                                 stored.colour[row] / 255)  # fmt: skip
        is_mirrored = bool(batch.owners[row, 15, 58])
        mirrored.append(is_mirrored)
        if is_mirrored:
            depth, owners, colour = (values[:, ::-1] for values in (depth, owners, colour))
        np.testing.assert_allclose(batch.depth[row], depth, atol=1e-6)
        np.testing.assert_array_equal(batch.owners[row], owners)
        np.testing.assert_array_equal(batch.obstacles[row], owners >= OBSTACLE)
        np.testing.assert_allclose(batch.colour[row].permute(1, 2, 0), colour, atol=1e-6)
    assert 0 < sum(mirrored) < 6


def test_a_mirror_turns_the_world_with_the_image(made):
    """The box is 0.1 m high everywhere, and its places are those of the image before, or -x."""
    batch = batch_of(made(), *range(6))
    places = pixel_places(batch.depth, batch.cameras)
    for row in range(6):
        box = places[row][batch.owners[row] == 3]
        np.testing.assert_allclose(box[:, 2], 0.1, atol=1e-5)
        sign = -1 if batch.owners[row, 15, 58] else 1
        expected = 0.1 + (np.array([5, 24]) - 30) * 0.7 / 70.4
        np.testing.assert_allclose(
            sorted(sign * np.array([box[:, 0].min(), box[:, 0].max()])), expected, atol=1e-5
        )


def test_views_of_superquadrics_follow_the_images_and_have_a_colour_for_each_object(made):
    data = made()
    assert len(data.train_dataloader()) == (6 + len(data.views.scenes)) // 4
    batch = batch_of(data, 5, 6, 7)
    assert batch.depth.shape == (3, HEIGHT, WIDTH)
    for owners, colour in zip(batch.owners[1:], batch.colour[1:], strict=True):
        shown = owners.unique()
        colours = [colour[:, owners == owner].unique(dim=1) for owner in shown]
        assert all(values.shape == (3, 1) for values in colours)
        assert len(torch.cat(colours, 1).unique(dim=1).T) == len(shown) > 1
    assert not batch.obstacles[1:].any()
    alone = data.views.training_batch(IndexBatch(0, torch.tensor([0, 1])), CPU)
    assert torch.equal(batch.depth[1:], alone.depth)
    assert torch.equal(batch.owners[1:], alone.owners)


def test_larger_scenes_are_farther_away(made):
    plain, changed = (batch_of(made(scale=s), *range(6)) for s in (0.0, 1.0))
    factors = changed.depth.flatten(1).amax(1) / plain.depth.flatten(1).amax(1)
    assert ((factors > 0.5) & (factors < 2)).all()
    assert factors.std() > 0.1
    heights = pixel_places(changed.depth, changed.cameras)[..., 2]
    np.testing.assert_allclose(heights.flatten(1).amax(1), 0.1 * factors, atol=1e-4)


@pytest.mark.parametrize("crop", [(64, 48), (20, 30), (1, 1)])
def test_a_window_shows_the_same_places(made, crop):
    whole, part = batch_of(made(), 2, 4, 7), batch_of(made(crop=crop), 2, 4, 7)
    assert part.depth.shape == (3, *crop[::-1])
    shift = (whole.cameras.intrinsics - part.cameras.intrinsics)[0]
    left, top = int(shift[2]), int(shift[3])
    window = np.s_[..., top : top + crop[1], left : left + crop[0]]
    for name in ("owners", "obstacles"):
        assert torch.equal(getattr(part, name), getattr(whole, name)[window])
    assert torch.equal(part.colour[:2], whole.colour[:2][window])
    places = pixel_places(whole.depth, whole.cameras)[:, window[1], window[2]]
    torch.testing.assert_close(pixel_places(part.depth, part.cameras), places, atol=1e-5, rtol=0)


def test_windows_differ_between_batches(made):
    data = made(crop=(20, 30))
    corners = {
        tuple(batch_of(data, row, epoch=epoch).cameras.intrinsics[0, 2:].tolist())
        for row in (0, 1)
        for epoch in range(4)
    }
    assert len(corners) > 4
    with pytest.raises(ConfigError, match="width and height up to"):
        made(crop=(65, 48))


def test_light_changes_colours_alone(made):
    plain, changed = (batch_of(made(brightness=b), *range(6)) for b in (0.0, 1.0))
    assert torch.equal(plain.depth, changed.depth)
    assert not torch.allclose(plain.colour, changed.colour, atol=0.05)
    assert (changed.colour >= 0).all()
    assert (changed.colour <= 1).all()


def test_colours_of_another_image_lie_over_half_of_the_images(made, tmp_path):
    stored = torch.from_numpy(StoredImages.open(tmp_path / "things/train").colour / 255)
    stored = stored.permute(0, 3, 1, 2).float()
    rows = (*range(6), 6, 7)
    weights = []
    for epoch in range(20):
        plain, mixed = (batch_of(made(mixing=m), *rows, epoch=epoch) for m in (0.0, 0.8))
        for before, after in zip(plain.colour, mixed.colour, strict=True):
            moved = (after - before).flatten()
            steps = (stored - before).flatten(1)
            fits = (steps @ moved) / (steps * steps).sum(1).clamp_min(1e-9)
            rest = (fits[:, None] * steps - moved).norm(dim=1)
            assert rest.min() < 1e-3
            weights.append(float(fits[rest.argmin()]))
    share = np.mean(np.array(weights) > 1e-4)
    assert 0.4 < share < 0.6
    assert 0.7 < max(weights) < 0.8001


def test_images_without_colours_stay_so(made):
    plain, mixed = (batch_of(made(0.5, mixing=m), *range(8)) for m in (0.0, 0.8))
    is_missing = [b.colour.isnan().flatten(1).all(1) for b in (plain, mixed)]
    assert torch.equal(*is_missing)
    assert 0 < is_missing[0].sum() < 8


def test_colours_are_left_out_of_the_share_that_is_asked_for(made):
    batches = [batch_of(made(colourless=0.5), *range(6), epoch=epoch) for epoch in range(20)]
    shares = torch.cat([b.colour.isnan().all(dim=1).flatten(1).float().mean(1) for b in batches])
    assert set(shares.tolist()) == {0.0, 1.0}
    assert 0.35 < float(shares.mean()) < 0.65


def test_an_image_follows_from_seed_epoch_and_number(made):
    settings = {"brightness": 1.0, "scale": 0.5, "tilt": 0.5, "noise": {"n": Gaussian(0.01)}}
    first, again = batch_of(made(**settings), 0, 4, 7), batch_of(made(**settings), 4)
    assert torch.equal(first.depth[1], again.depth[0])
    assert torch.equal(first.colour[1], again.colour[0])
    later = batch_of(made(**settings), 4, epoch=1)
    assert not torch.equal(later.depth, again.depth)


def test_validation_is_the_same_every_time(made):
    data = made(limit=2)
    assert len(data.val_dataloader()) == 1
    first, later = (
        data.validation_batch(IndexBatch(epoch, torch.arange(4)), CPU) for epoch in (0, 3)
    )
    assert torch.equal(first.depth, later.depth)
    assert torch.equal(first.owners, later.owners)


def test_unusable_images_are_one_line(made, tmp_path):
    with pytest.raises(StorageError, match="made otherwise"):
        StoredImages.create(tmp_path / "things/train", 6, (WIDTH, HEIGHT), {"seed": 5})
    assert len(StoredImages.create(tmp_path / "things/train", 6, (WIDTH, HEIGHT), {"seed": 0})) == 6
    (tmp_path / "things/val/depth.npy").unlink()
    with pytest.raises(StorageError, match="holds no images"):
        made()


def test_images_have_the_size_of_the_views(made, tmp_path):
    for name in ("train", "val"):
        folder = tmp_path / "others" / name
        StoredImages.create(folder, 1, (32, 24), {})
    data = made()
    with pytest.raises(ConfigError, match="views have"):
        PartImages(data.views, tmp_path / "others", 0.0, 0.0, 0.0, 0.0)
