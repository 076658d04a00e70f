"""What is about a table, beside where its floor and edges are."""

import functools

import numpy as np
import torch
from tests.unit.kernels import analytic

from scenefw.core.batches import SceneParameters
from scenefw.core.rng import Streams
from scenefw.data.batches.surroundings import surrounding_depths
from scenefw.kernels.cameras import floor_depths, pixel_places, stack_cameras

COUNT = 40


def box():
    """One box of 10 cm in each scene."""
    return SceneParameters(
        torch.full((COUNT, 1, 3), 0.05), torch.full((COUNT, 1, 3), 40.0),
        torch.eye(3).expand(COUNT, 1, 3, 3), torch.tensor([0.0, 0.0, 0.05]).expand(COUNT, 1, 3),
        torch.ones(COUNT, 1, dtype=torch.bool),
    )  # fmt: skip


@functools.cache
def around(every):
    """Images in which the surroundings of each `every`-th scene are changed."""
    changed = np.arange(COUNT) % every == 0
    cameras = stack_cameras([analytic.camera()] * COUNT)
    streams = Streams.of(0, 1, indices=np.arange(COUNT))
    return surrounding_depths(box(), cameras, streams, changed), cameras


def test_a_floor_goes_on_where_nothing_is_changed():
    depth, cameras = around(2)
    floor = floor_depths(cameras).view_as(depth)
    assert torch.equal(depth[1::2], floor[1::2])
    assert not torch.equal(depth[::2], floor[::2])


def test_tables_hold_what_stands_on_them_and_nothing_hides_it():
    depth, cameras = around(1)
    places = pixel_places(depth, cameras)
    under = pixel_places(floor_depths(cameras).view_as(depth), cameras)[..., :2].abs()
    on_table = (under < 0.05).all(dim=-1)  # where the box stands
    assert on_table.any()
    assert (places[..., 2][on_table].abs() < 1e-4).all()


def test_beyond_an_edge_lies_a_floor_that_is_level():
    depth, cameras = around(1)
    heights = pixel_places(depth, cameras)[..., 2]
    for row in heights:
        below = row[row < -0.1]
        if below.numel() < 50:
            continue
        level = below.min()
        assert -0.81 < level < -0.14
        assert ((below - level).abs() < 1e-3).float().mean() > 0.2  # others stand on it
    assert (heights < -0.1).any()
    assert (heights > 0.05).any()
