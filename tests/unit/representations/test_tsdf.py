"""TSDF with and without the floor."""

import pytest
import torch

from scenefw.core.batches import SceneParameters
from scenefw.core.types import GridSpec
from scenefw.representations.tsdf import TSDF, with_floor
from scenefw.representations.volumes import ExactScenes, scene_volumes

GRID = GridSpec(resolution=20)
BALL = SceneParameters(
    torch.full((1, 1, 3), 0.1),
    torch.full((1, 1, 3), 2.0),
    torch.eye(3)[None, None],
    torch.tensor([[[0.0, 0.0, 0.1]]]),
    torch.ones(1, 1, dtype=torch.bool),
)


def test_floor_alone_is_truncated_height():
    empty = torch.full((2, 1, *GRID.shape), GRID.truncation)
    floor = with_floor(empty, GRID)
    heights = torch.from_numpy(GRID.centres()[..., 2]).float()
    assert floor.shape == empty.shape
    assert torch.allclose(floor[1, 0], heights.clamp(max=GRID.truncation), atol=1e-6)
    assert floor.min() >= -GRID.truncation


def test_floor_deep_below_is_cut():
    grid = GridSpec(resolution=20, lower=(-0.5, -0.5, -0.6), truncation_voxels=3)
    floor = with_floor(torch.full((1, 1, *grid.shape), grid.truncation), grid)
    assert floor.min() == -torch.tensor(grid.truncation)


def test_nearer_of_object_and_floor_wins():
    alone = scene_volumes(BALL, GRID).tsdf
    standing = TSDF(floor=True).of_scenes(ExactScenes(BALL, GRID))
    heights = torch.from_numpy(GRID.centres()[..., 2]).float()
    assert torch.equal(TSDF().of_scenes(ExactScenes(BALL, GRID)), alone)
    assert torch.allclose(standing[0, 0], torch.minimum(alone[0, 0], heights), atol=1e-6)
    assert (standing < alone).any()


def test_kept_in_half_precision():
    assert (
        with_floor(torch.zeros(1, 1, *GRID.shape, dtype=torch.float16), GRID).dtype == torch.float16
    )


def test_networks_have_it_in_truncations():
    metres = torch.tensor([-2.0, -0.5, 0.0, 0.25, 3.0]) * GRID.truncation
    units = TSDF().to_network(metres, GRID)
    assert units.tolist() == pytest.approx([-1, -0.5, 0, 0.25, 1])
    torch.testing.assert_close(TSDF().from_network(units, GRID)[1:4], metres[1:4])
