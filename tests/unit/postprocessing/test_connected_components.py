import numpy as np
import pytest
import torch
from tests.unit.postprocessing.stacks import box, ious, sphere, touching, volumes

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.postprocessing.connected_components import ConnectedComponents

GRIDS = [GridSpec(resolution=32), GridSpec(resolution=64)]


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: str(grid.resolution))
def test_separate_objects_are_found_largest_first(grid):
    centres = np.array([[-0.2, 0, 0.1], [0.2, 0, 0.1]])
    parts = [sphere(centres[0], 0.08), box(centres[1], np.array([0.1, 0.12, 0.08]))]
    tsdf, votes, labels = volumes(parts, centres, grid)
    instances, found = ConnectedComponents().extract(tsdf, votes, grid)
    assert ious(instances, labels).min() == 1.0
    np.testing.assert_allclose(found.numpy(), centres[::-1], atol=0.6 * grid.voxel_size)
    assert instances.dtype == torch.int32


def test_touching_objects_become_one():
    tsdf, votes, _ = volumes(*touching(), GRIDS[1])
    instances, centres = ConnectedComponents().extract(tsdf, votes, GRIDS[1])
    assert len(centres) == 1
    assert torch.equal(instances > 0, tsdf < 0)


def test_specks_and_emptiness_are_no_instances():
    grid = GRIDS[1]
    tsdf = torch.ones(grid.shape)
    tsdf[3, 3, 3] = -1
    instances, centres = ConnectedComponents().extract(tsdf, torch.zeros(3, *grid.shape), grid)
    assert not instances.any()
    assert centres.shape == (0, 3)


def test_bad_shape_is_named():
    with pytest.raises(InputError, match="expected"):
        ConnectedComponents().extract(torch.ones(2, 2, 2), torch.zeros(3, 2, 2, 2), GRIDS[0])
