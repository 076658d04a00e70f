"""Crops about things with their shells, beside the images and things that they are of."""

import numpy as np
import pytest
import torch
from plugins.things.tests.things_folder import item, write_things

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError, StorageError
from scenefw.kernels.cameras import camera_of, pixel_places
from scenefw.noise.gaussian import Gaussian
from scenefw.shapes.object_shell import ENTRY, EXIT
from scenefw_things.images.stored_solids import StoredSolids
from scenefw_things.scenes.scene import OBJECT
from scenefw_things.shapes.families import FAMILIES
from scenefw_things.shapes.part_unions import inside
from scenefw_things.shells.data import ObjectShells

CPU = torch.device("cpu")
BATCH = IndexBatch(0, torch.tensor([0, 1]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_things(tmp_path_factory.mktemp("things"))


@pytest.fixture
def made(folder):
    def data(**changes):
        plain = {"batch_size": 2, "objects": 2, "resolution": 48, "min_pixels": 20, "scale": 0.0,
                 "tilt": 0.0, "lift": 0.0, "min_width": 0.02}  # fmt: skip
        return ObjectShells(folder, **(plain | changes))

    return data


def test_solids_are_the_things(folder):
    solids = StoredSolids.open(folder / "val/solids.npz")
    assert solids.item_ends.tolist() == [0, 3]
    assert solids.items(np.array([0]), np.array([2])).tolist() == [1]
    assert solids.parts(0) == []
    bowl = item(FAMILIES, "bowl", (0.0, 0.0, 0.0), OBJECT, 1).thing
    places = np.random.default_rng(0).uniform((-0.1, -0.1, 0), (0.1, 0.1, 0.1), (500, 3))
    distances = bowl.signed_distances(places)
    clear = np.abs(distances) > 1e-5
    np.testing.assert_array_equal(inside(places, solids.parts(1))[clear], distances[clear] < 0)
    assert np.abs(bowl.signed_distances(solids.points[1].astype(float))).max() < 1e-6


@pytest.mark.parametrize("scale", [0.0, 1.0])
def test_visible_surfaces_are_entries_in_a_mirror_and_in_any_size(made, scale):
    """Half of the images are mirrored, so every one of them is in some epoch."""
    data = made(scale=scale)
    for epoch in range(4):
        batch = data.training_batch(IndexBatch(epoch, torch.tensor([0, 1, 2, 3])), CPU)
        crops, shells = batch.crops, batch.shells
        assert (shells.amodal | ~crops.visible).float().mean() > 0.99
        shown = crops.visible & shells.amodal
        errors = (crops.depth - shells.depths[:, ENTRY]).abs() / batch.scales[:, None, None]
        assert errors[shown].median() < 0.015  # rays of a crop and of the image lie apart
        assert (shells.depths[:, EXIT] >= shells.depths[:, ENTRY]).all()
        assert (batch.scales > 0.02).all()


def test_true_solids_lie_where_the_shells_are(made):
    data = made(tilt=1.0, lift=0.01)
    batch, solids = data.validation_batch(BATCH, CPU), data.validation_solids(BATCH)
    assert len(solids) == len(batch.scales) == 4
    for number, (parts, points) in enumerate(solids):
        camera = camera_of(batch.crops.cameras, number)
        local = (points - camera.T_world_camera[:3, 3]) @ camera.T_world_camera[:3, :3]
        pixels = local[:, :2] / local[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        u, v = np.rint(pixels).astype(int).T
        shown = (u >= 0) & (v >= 0) & (u < 48) & (v < 48)
        assert shown.mean() > 0.6
        entry, leaving = batch.shells.depths[number, [ENTRY, EXIT]].numpy()
        z, u, v = local[shown, 2], u[shown], v[shown]
        within = (z > entry[v, u] - 0.01) & (z < leaving[v, u] + 0.01)
        assert within.mean() > 0.9  # rims and edges lie beside the pixel's ray
        middle = (entry + leaving) / 2
        depths = torch.from_numpy(middle)[None].expand(4, -1, -1).float()
        places = pixel_places(depths, batch.crops.cameras)[number].double().numpy()
        solid = batch.shells.amodal[number].numpy() & ~batch.shells.hollow[number].numpy()
        assert inside(places[solid], parts).mean() > 0.95


def test_bowls_have_hollows_and_cans_have_none(made):
    batch = made().validation_batch(BATCH, CPU)
    counts = batch.shells.hollow.sum(dim=(1, 2))
    ratios = counts / batch.shells.amodal.sum(dim=(1, 2))
    assert ratios.max() > 0.01
    assert ratios.min() < 0.001


def test_crops_follow_from_seed_epoch_and_number(made):
    data = made(noise={"n": Gaussian(0.01)}, tilt=0.5, scale=0.5)
    whole, alone = (
        data.training_batch(IndexBatch(3, torch.tensor(rows)), CPU) for rows in ([0, 2], [2])
    )
    for name in ("depth", "visible", "others", "colour"):
        first, second = getattr(whole.crops, name)[2:], getattr(alone.crops, name)
        torch.testing.assert_close(first, second, rtol=0, atol=0, equal_nan=True)
    assert torch.equal(whole.shells.depths[2:], alone.shells.depths)
    later = data.training_batch(IndexBatch(4, torch.tensor([2])), CPU)
    assert not torch.equal(later.crops.depth, alone.crops.depth)
    first, second = (
        data.validation_batch(IndexBatch(e, torch.tensor([0, 1])), CPU) for e in (0, 5)
    )
    assert torch.equal(first.crops.depth, second.crops.depth)


class Fog:
    """Noise in which nothing is measured."""

    def apply(self, depth, cameras, seeds):
        return torch.zeros_like(depth)


def test_what_noise_hides_has_an_empty_shell(made):
    data = made(noise={"n": Gaussian(0.0)})
    assert data.training_batch(BATCH, CPU).shells.amodal.any()
    data.changes.noise["n"] = Fog()
    batch = data.training_batch(BATCH, CPU)
    assert not batch.crops.visible.any()
    assert not batch.shells.amodal.any()
    assert not batch.shells.hollow.any()


def test_unusable_data_are_one_line(made, folder, tmp_path):
    with pytest.raises(ConfigError, match="margins"):
        made(margins=(2.0, 1.5))
    with pytest.raises(ConfigError, match=r"no image in .* shows an object"):
        made(min_pixels=5000)
    with pytest.raises(StorageError, match="holds no images"):
        ObjectShells(tmp_path)
    for name in ("train", "val"):
        (tmp_path / name).symlink_to(folder / name)
    solids = folder / "val/solids.npz"
    content = solids.read_bytes()
    solids.write_bytes(content[: len(content) // 2])
    try:
        with pytest.raises(StorageError, match="holds no solids"):
            ObjectShells(tmp_path)
    finally:
        solids.write_bytes(content)
