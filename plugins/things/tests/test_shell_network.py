"""The network of object shells: what it takes and gives."""

import dataclasses

import pytest
import torch

from scenefw.core.batches import CameraBatch
from scenefw.core.errors import ConfigError
from scenefw.shapes.object_shell import ENTRY, EXIT, GAP_END, GAP_START
from scenefw_things.shells.batches import ObjectCrops
from scenefw_things.shells.network import CHANNELS, ObjectShells, crop_features

SIZE, COUNT = 32, 4


def crops(seed=0, colour=True):
    """Random surfaces before a floor that a camera sees from above."""
    draws = torch.Generator().manual_seed(seed)
    depth = 0.7 + 0.1 * torch.rand(COUNT, SIZE, SIZE, generator=draws)
    ids = torch.randint(0, 3, depth.shape, generator=draws)
    depth[:, 0] = 0
    pose = torch.diag(torch.tensor([1.0, -1, -1, 1]))
    pose[2, 3] = 0.8
    lens = torch.tensor([150.0, 150.0, 15.5, 15.5])
    cameras = CameraBatch(SIZE, SIZE, lens.expand(COUNT, -1), pose.expand(COUNT, -1, -1))
    colours = torch.rand(COUNT, 3, SIZE, SIZE, generator=draws) if colour else None
    measured = depth > 0
    return ObjectCrops(depth, measured & (ids == 1), measured & (ids == 2), cameras, colours)


def network(**settings):
    torch.manual_seed(0)
    return ObjectShells((8, 12, 16), latent_size=5, **settings)


def test_depths_are_in_order_along_each_ray():
    said = network().eval()(crops())
    assert said.amodal.shape == said.hollow.shape == (COUNT, SIZE, SIZE)
    order = said.depths[:, [ENTRY, GAP_START, GAP_END, EXIT]]
    assert (order.diff(dim=1) >= -1e-6).all()
    assert said.draws is None


def test_two_codes_are_drawn_for_the_first_crops():
    model = network(drawn=0.5)
    said = model(crops(), torch.Generator().manual_seed(0))
    first, second = said.draws
    assert first.depths.shape == second.depths.shape == (2, 4, SIZE, SIZE)
    assert not torch.equal(first.depths, second.depths)
    again = network(drawn=0.5)(crops(), torch.Generator().manual_seed(0))
    assert torch.equal(again.draws[0].depths, first.depths)
    assert network(drawn=0.0)(crops(), torch.Generator()).draws is None


@torch.no_grad()
def test_samples_come_code_after_code_and_zero_is_the_best_guess():
    model = network().eval()
    codes = torch.stack([torch.zeros(COUNT, 5), torch.ones(COUNT, 5)])
    said, guess = model.sample(crops(), codes), model(crops())
    torch.testing.assert_close(said.depths[:COUNT], guess.depths)
    torch.testing.assert_close(said.amodal[:COUNT], guess.amodal)
    assert not torch.allclose(said.depths[COUNT:], guess.depths)
    changes = said.amodal[COUNT:] - guess.amodal
    block = changes.unfold(1, 2, 2).unfold(2, 2, 2).flatten(3)
    torch.testing.assert_close(block, block.mean(dim=3, keepdim=True).expand_as(block))


@torch.no_grad()
def test_a_crop_without_colours_is_one_of_a_depth_camera():
    model, plain = network().eval(), crops(colour=False)
    empty = dataclasses.replace(plain, colour=torch.full((COUNT, 3, SIZE, SIZE), torch.nan))
    torch.testing.assert_close(model(plain).depths, model(empty).depths)
    assert not torch.allclose(model(plain).depths, model(crops()).depths)


@torch.no_grad()
def test_an_object_without_pixels_gives_numbers():
    nothing = dataclasses.replace(crops(), visible=torch.zeros(COUNT, SIZE, SIZE, dtype=torch.bool))
    assert network().eval()(nothing).depths.isfinite().all()
    assert crop_features(nothing).isfinite().all()
    assert crop_features(nothing).shape == (COUNT, CHANNELS, SIZE, SIZE)


@torch.no_grad()
def test_farther_and_larger_is_alike_but_for_size():
    """Depth and height in widths of the crop: only the size and the log of heights differ."""
    near, double = crops(colour=False), crops(colour=False)
    pose = double.cameras.T_world_camera.clone()
    pose[:, :3, 3] *= 2
    cameras = CameraBatch(SIZE, SIZE, double.cameras.intrinsics, pose)
    double = dataclasses.replace(double, depth=2 * double.depth, cameras=cameras)
    differ = [i for i in range(CHANNELS)
              if not torch.allclose(crop_features(near)[:, i], crop_features(double)[:, i],
                                    atol=1e-5)]  # fmt: skip
    assert differ == [5, 7]


def test_bad_settings_are_told():
    with pytest.raises(ConfigError, match="expected two or more"):
        ObjectShells((8,))
    with pytest.raises(ConfigError, match="latent_size"):
        ObjectShells((8, 12), latent_size=0)
