import numpy as np
import pytest
import torch

from scenefw.core.batches import PartialTSDF
from scenefw.core.types import GridSpec
from scenefw.perception.estimate.carving import carve, whole_objects


def sphere(grid, centre, radius):
    return torch.from_numpy(np.linalg.norm(grid.centres() - centre, axis=-1) - radius).float()


def cut(distance, grid):
    return distance.clamp(-grid.truncation, grid.truncation)


@pytest.mark.parametrize("resolution", [32, 64])
def test_carving_keeps_what_is_unseen_or_on_the_surface(resolution):
    grid = GridSpec(resolution=resolution)
    wall = torch.tensor(grid.centres()[..., 1], dtype=torch.float32)  # seen free space is y < 0
    partial = PartialTSDF(cut(-wall, grid)[None, None], (wall < grid.voxel_size)[None, None])
    before = cut(sphere(grid, (0, 0, 0.05), 0.2), grid)
    after = carve(before, partial, grid)
    y, z = grid.centres()[..., 1], grid.centres()[..., 2]
    inside = after.numpy() < 0
    assert not inside[y < -2.5 * grid.voxel_size].any()
    assert not inside[z < 0].any()
    untouched = (y > 0) & (before.numpy() > -z)
    np.testing.assert_array_equal(after.numpy()[untouched], before.numpy()[untouched])
    assert inside[untouched].any()
    assert after.max() <= grid.truncation


@pytest.mark.parametrize("resolution", [48, 64])
@pytest.mark.parametrize("label", [3, 4])
def test_splinters_go_and_labels_close_up(resolution, label):
    """A single voxel is lost, be it an instance of its own or a part of another."""
    grid = GridSpec(resolution=resolution)
    large = sphere(grid, (0.2, 0, 0.2), 0.1)
    other = sphere(grid, (-0.2, 0, 0.2), 0.08)
    corner = grid.to_world(np.full(3, resolution * 3 // 4))
    splinter = sphere(grid, corner, 0.6 * grid.voxel_size)
    tsdf = cut(torch.minimum(torch.minimum(large, other), splinter), grid)
    instances = torch.zeros(grid.shape, dtype=torch.int32)
    instances[large < 0] = 5
    instances[other < 0] = 3
    instances[splinter < 0] = label
    shape, labels = whole_objects(tsdf, instances, grid)
    assert (splinter < 0).sum() == 1
    assert (labels[splinter < 0] == 0).all()
    assert (shape[splinter < 0] > 0).all()
    assert (labels[other < 0] == 1).all()
    assert (labels[large < 0] == 2).all()
    assert labels.dtype == torch.int32


@pytest.mark.parametrize("resolution", [32, 64])
def test_two_pieces_are_two_objects(resolution):
    grid = GridSpec(resolution=resolution)
    large = sphere(grid, (0.2, 0, 0.2), 0.1)
    small = sphere(grid, (-0.2, 0, 0.2), 0.06)
    third = sphere(grid, (0, 0.3, 0.2), 0.08)
    tsdf = cut(torch.minimum(torch.minimum(large, small), third), grid)
    instances = ((large < 0) | (small < 0)).int() + 2 * (third < 0).int()
    shape, labels = whole_objects(tsdf, instances, grid)
    assert torch.equal(shape, tsdf)
    for mask, label in ((large < 0, 1), (third < 0, 2), (small < 0, 3)):
        assert (labels[mask] == label).all()


def test_labels_outside_the_shape_are_dropped():
    grid = GridSpec(resolution=32)
    tsdf = cut(sphere(grid, (0, 0, 0.2), 0.1), grid)
    instances = torch.ones(grid.shape, dtype=torch.int32)
    _, labels = whole_objects(tsdf, instances, grid)
    assert ((labels > 0) == (tsdf < 0)).all()
