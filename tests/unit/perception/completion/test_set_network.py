"""Networks of sets as methods that complete views."""

import numpy as np
import pytest
import torch

from scenefw.core.batches import PartialTSDF
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.object_sets import ObjectSetPrediction
from scenefw.core.types import GridSpec
from scenefw.models.set_autoencoder import SetAutoencoder
from scenefw.models.set_placed import PlacedSetAutoencoder
from scenefw.models.set_placed_vae import PlacedSetVAE
from scenefw.models.set_vae import SetVAE
from scenefw.perception.completion.set_network import SetNetwork
from scenefw.perception.completion.suppression import chosen_objects
from scenefw.perception.observation.observation import Observation
from scenefw.perception.steps import Fits, Objects

SMALL = {"encoder_widths": (4, 4), "decoder_widths": (4, 4), "code_size": 4}


class Checkpoint:
    def __init__(self, model, grid):
        self.model, self.grid, self.metadata = model, grid, {"steps": 3}


class TwoBalls(torch.nn.Module):
    """Predicts two balls, one of them twice, and says how sure it is."""

    sees, latent_shape = "view", ()

    def __init__(self, grid):
        super().__init__()
        apart = [np.linalg.norm(grid.centres() - at, axis=-1) for at in self.centres]
        balls = [torch.from_numpy(200 * (0.1 - one)).float() for one in apart]
        self.logits = torch.stack([balls[0], balls[1], balls[0] - 1, balls[1] * 0 - 5])[None]

    centres = ((-0.2, 0.0, 0.1), (0.2, 0.1, 0.1))

    def decompose(self, volume):
        count = len(volume)
        none = torch.zeros(count, 4, 0)
        return ObjectSetPrediction(
            self.logits.expand(count, -1, -1, -1, -1), none, torch.zeros(count, 4).long(),
            torch.zeros(count, 0, 1, 1, 1), existence=torch.tensor([[2.0, 3, 1, 4]] * count),
        )  # fmt: skip


def scenes_of(method, samples=1, grid=None, seed=0):
    """What a method says of a view of nothing."""
    grid = method.grid if grid is None else grid
    shape = (1, 1, *grid.shape)
    partial = PartialTSDF(torch.full(shape, grid.truncation), torch.zeros(shape, dtype=torch.bool))
    view, generator = Observation(None, partial, grid), torch.Generator().manual_seed(seed)
    sets = method.complete(Fits(Objects(None)), view, samples, generator)
    assert all(each.superquadrics is None for each in sets)
    return [each.objects for each in sets]


@pytest.mark.parametrize("resolution", [32, 48])
def test_objects_of_a_network_are_balls_where_it_says(resolution):
    grid = GridSpec(resolution)
    method = SetNetwork(Checkpoint(TwoBalls(grid), grid), max_iou=0.3)
    (scene,) = scenes_of(method, 3)
    assert np.unique(scene.instances).tolist() == [
        0,
        1,
        2,
    ]  # the duplicate and the empty one aren't
    assert (scene.tsdf.dtype, scene.instances.dtype) == (np.float32, np.int32)
    for label, centre in enumerate(TwoBalls.centres, start=1):
        inside = grid.centres()[scene.instances == label]
        np.testing.assert_allclose(inside.mean(axis=0), centre, atol=grid.voxel_size)
        volume = len(inside) * grid.voxel_size**3
        assert volume == pytest.approx(4 / 3 * np.pi * 0.1**3, rel=0.12)
    exact = (
        np.min([np.linalg.norm(grid.centres() - at, axis=-1) for at in TwoBalls.centres], 0) - 0.1
    )
    near = np.abs(exact) < grid.truncation / 2
    assert np.abs(scene.tsdf - exact)[near].mean() < 0.3 * grid.voxel_size
    assert np.abs(scene.tsdf - exact)[near].max() < grid.voxel_size
    predicted = TwoBalls(grid).decompose(torch.zeros(1))
    for suppress, count in ((None, 3), (0.3, 2)):
        assert chosen_objects(predicted, 0, grid, 3e-5, suppress).exists.sum() == count


def test_networks_with_a_prior_draw_and_others_do_not():
    grid = GridSpec(16)
    torch.manual_seed(0)
    plain = SetNetwork(Checkpoint(SetAutoencoder(16, 3, "view", **SMALL), grid))
    assert len(scenes_of(plain, 4)) == 1
    vae = PlacedSetVAE(16, 3, **SMALL)
    drawing = SetNetwork(Checkpoint(vae, grid))
    noise = []
    sample = vae.sample
    vae.sample = lambda seen, latents: noise.append(latents) or sample(seen, latents)
    assert len(scenes_of(drawing, 3, seed=1)) == 3
    assert not noise[0].any()
    assert (noise[1] != noise[2]).any()


@pytest.mark.parametrize("smoothing", [0.0, 0.7, 2.0])
def test_what_is_thin_is_kept(smoothing):
    grid = GridSpec(32)
    model = TwoBalls(grid)
    model.logits = torch.full_like(model.logits, -9.0)
    model.logits[0, 0, 8:24, 10, 12] = 9.0
    model.logits[0, 1, 8:24, 20, 12:14] = 9.0
    method = SetNetwork(Checkpoint(model, grid), smoothing=smoothing)
    (scene,) = scenes_of(method)
    assert np.array_equal(scene.tsdf < 0, scene.instances > 0)
    assert np.bincount(scene.instances.ravel()).tolist()[1:] == [16, 32]


def test_without_a_prior_of_the_view_the_first_scene_is_drawn_too():
    """Zeros are all codes alike, so all objects would be one."""
    grid, noise = GridSpec(16), []
    vae = SetVAE(16, 3, **SMALL)
    sample = vae.sample
    vae.sample = lambda seen, latents: noise.append(latents) or sample(seen, latents)
    method = SetNetwork(Checkpoint(vae, grid))
    assert len(scenes_of(method, 2)) == 2
    assert all(one.any() for one in noise)


def test_nothing_predicted_is_an_empty_scene():
    grid = GridSpec(16)
    model = TwoBalls(grid)
    model.logits = torch.full_like(model.logits, -9.0)
    (scene,) = scenes_of(SetNetwork(Checkpoint(model, grid)))
    assert not scene.instances.any()
    assert (scene.tsdf == np.float32(grid.truncation)).all()


def test_wrong_networks_and_grids_are_one_line():
    whole = PlacedSetAutoencoder(16, 3, "occupancy", **SMALL)
    with pytest.raises(ConfigError, match="decomposes complete volumes"):
        SetNetwork(Checkpoint(whole, GridSpec(16)))
    method = SetNetwork(Checkpoint(TwoBalls(GridSpec(16)), GridSpec(16)))
    with pytest.raises(InputError, match="fuse it on the checkpoint's grid"):
        scenes_of(method, grid=GridSpec(32))
    with pytest.raises(ConfigError, match="max_iou"):
        SetNetwork(Checkpoint(TwoBalls(GridSpec(16)), GridSpec(16)), max_iou=2.0)


def test_codes_of_another_decoder_are_one_line():
    model = PlacedSetAutoencoder(16, 3, "view", **SMALL)
    boxes = torch.zeros(1, 2, 2, 3)
    with pytest.raises(InputError, match="decode them with the network that made them"):
        model.head.decode(torch.zeros(1, 2, 7), boxes)
    with pytest.raises(InputError, match="a centre and half sides for each code"):
        model.head.decode(torch.zeros(1, 3, 4), boxes)
