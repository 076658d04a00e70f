"""A network that says which neighbouring pixels show the same object."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.batches import CameraBatch
from scenefw.core.errors import ConfigError
from scenefw.models.part_affinity import CHANNELS, PartAffinity, colour_features, pixel_features


def camera_down(width, height, turn=0.0, far=0.0):
    """A camera 1 m above the floor that looks straight down, turned about its axis."""
    cos, sin = torch.tensor(turn).cos(), torch.tensor(turn).sin()
    pose = torch.eye(4)
    pose[:3, :3] = torch.tensor([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
    pose[:2, :2] = pose[:2, :2] @ torch.tensor([[cos, -sin], [sin, cos]])
    pose[:3, 3] = torch.tensor([far, -far, 1.0])
    inner = torch.tensor([[100.0, 100.0, (width - 1) / 2, (height - 1) / 2]])
    return CameraBatch(width, height, inner, pose[None])


@pytest.mark.parametrize("shown", [False, True])
@pytest.mark.parametrize("size", [(40, 30), (33, 47)])
def test_each_pixel_gets_two_or_three_logits_at_any_size(size, shown):
    width, height = size
    network = PartAffinity(widths=(4, 6, 8), shown=shown).eval()
    logits = network(torch.full((1, height, width), 0.9), camera_down(width, height))
    assert logits.shape == (1, 3 if shown else 2, height, width)
    assert logits.isfinite().all()


@pytest.mark.parametrize("size", [(40, 30), (33, 47)])
def test_colours_count_where_an_image_has_them(size):
    """Two images, the second without colour, which is as if the network saw none."""
    torch.manual_seed(0)
    network = PartAffinity((4, 6, 8), shown=True, obstacles=True, colour=True).eval()
    cameras = camera_down(*size)
    cameras = CameraBatch(*size, *(t.expand(2, *t.shape[1:]) for t in (
        cameras.intrinsics, cameras.T_world_camera)))  # fmt: skip
    depth, colour = torch.full((2, *size[::-1]), 0.9), torch.rand(2, 3, *size[::-1])
    colour[1] = torch.nan
    plain = network(depth, cameras)
    assert plain.shape == (2, 4, *size[::-1])
    assert torch.equal(network(depth, cameras, colour), plain)  # before it has learnt colours
    torch.nn.init.normal_(network.colour[-1].weight)
    coloured = network(depth, cameras, colour)
    assert not torch.allclose(coloured[0], plain[0], atol=1e-3)
    brighter = network(depth, cameras, 0.5 * colour + 0.3)
    assert torch.allclose(brighter[0], coloured[0], atol=1e-3)
    assert torch.equal(coloured[1], plain[1])


@pytest.mark.parametrize("level", [0.0, 0.5, 1.0])
def test_an_image_of_one_colour_has_no_edges(level):
    features = colour_features(torch.full((1, 3, 12, 16), level))
    assert features.shape == (1, 3, 12, 16)
    assert features.abs().max() < 1e-4
    assert not colour_features(torch.full((1, 3, 12, 16), torch.nan)).any()


def test_what_has_no_depth_has_no_features():
    depth = torch.rand(1, 12, 16) + 0.5
    depth[0, 3, 5] = 0.0
    found = pixel_features(depth, camera_down(16, 12))
    assert found.shape == (1, CHANNELS, 12, 16)
    assert not found[0, :, 3, 5].any()
    assert found.isfinite().all()


@pytest.mark.parametrize("far", [5.0, 5000.0, float("inf")])
def test_what_is_far_away_is_as_if_it_were_not_measured(far):
    """The floor of a traced image goes on for kilometres below its horizon."""
    near = torch.full((1, 12, 16), 0.8)
    seen, nothing = near.clone(), near.clone()
    seen[0, :4], nothing[0, :4] = far, 0.0
    here, there = (pixel_features(depth, camera_down(16, 12)) for depth in (seen, nothing))
    assert torch.equal(here, there)
    assert not torch.equal(here, pixel_features(near, camera_down(16, 12)))


def test_features_of_a_plane_are_its_normal_and_its_height():
    found = pixel_features(torch.full((1, 12, 16), 0.8), camera_down(16, 12))[0, :, 5:7, 5:7]
    inner = found.permute(1, 2, 0).flatten(0, 1)
    assert inner[:, :18].abs().max() < 1e-6  # it neither rises nor bends
    normals = inner[:, 18:24].view(-1, 2, 3)
    assert torch.allclose(normals[..., 2].abs(), torch.ones(4, 2), atol=1e-5)
    height = torch.asinh(torch.tensor(0.2 / 0.01)) / 3
    assert torch.allclose(inner[:, 24], height.expand(4), atol=1e-5)


@given(st.floats(-1.0, 1.0))
def test_places_far_from_the_origin_look_the_same(far):
    depth = 0.7 + 0.1 * torch.rand(1, 12, 16, generator=torch.Generator().manual_seed(0))
    here, there = (pixel_features(depth, camera_down(16, 12, far=f)) for f in (0.0, far))
    assert torch.allclose(here, there, atol=1e-3)


def test_a_turn_of_the_camera_turns_normals_alone():
    depth = 0.7 + 0.01 * torch.rand(1, 12, 16, generator=torch.Generator().manual_seed(0))
    here, turned = (pixel_features(depth, camera_down(16, 12, turn=t)) for t in (0.0, 1.2))
    others = [k for k in range(CHANNELS) if not 18 <= k < 24 or k in (20, 23)]
    assert torch.allclose(here[:, others], turned[:, others], atol=1e-4)
    assert not torch.allclose(here[:, 18:24], turned[:, 18:24], atol=1e-2)


@pytest.mark.parametrize("wrong", [{"widths": [8]}, {"widths": [8, 0]}, {"focal": 0.0}])
def test_bad_settings(wrong):
    with pytest.raises(ConfigError, match="part_affinity has"):
        PartAffinity(**{"widths": [8, 8], "shown": False, **wrong})


def test_obstacles_need_objects():
    with pytest.raises(ConfigError, match="obstacles without objects"):
        PartAffinity((4, 8), shown=False, obstacles=True)


def test_features_keep_their_millimetres_in_mixed_precision():
    depth, camera = 0.7 + 0.2 * torch.rand(1, 12, 16), camera_down(16, 12, turn=0.3, far=1.3)
    exact = pixel_features(depth, camera)
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(pixel_features(depth, camera), exact)
