import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from tests.unit.postprocessing.stacks import box, ious, sphere, touching, volumes

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import GridSpec
from scenefw.postprocessing.hough_voting import HoughVoting

GRIDS = [GridSpec(resolution=32), GridSpec(resolution=64)]


def noisy(votes, blur, noise, seed=0):
    """Votes as a network gives them: blurred over borders, with smooth errors."""
    rng = np.random.default_rng(seed)
    errors = ndimage.gaussian_filter(rng.normal(size=votes.shape), (0, 2, 2, 2))
    blurred = ndimage.gaussian_filter(votes.numpy(), (0, blur, blur, blur))
    return torch.tensor(blurred + noise * errors / errors.std(), dtype=torch.float32)


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: str(grid.resolution))
def test_exact_votes_part_touching_objects(grid):
    parts, centres = touching()
    tsdf, votes, labels = volumes(parts, centres, grid)
    instances, found = HoughVoting().extract(tsdf, votes, grid)
    assert instances.dtype == torch.int32
    assert torch.equal(instances > 0, tsdf < 0)
    assert len(found) == 4
    assert ious(instances, labels).min() > (0.95 if grid.resolution == 64 else 0.85)
    nearest = np.linalg.norm(found.numpy()[:, None] - centres[None], axis=2).min(axis=0)
    assert nearest.max() < 0.15 * grid.voxel_size  # finer than a voxel


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: str(grid.resolution))
def test_without_smoothing_exact_votes_give_exact_instances(grid):
    tsdf, votes, labels = volumes(*touching(), grid)
    instances, _ = HoughVoting(smoothing=0).extract(tsdf, votes, grid)
    assert ious(instances, labels).min() == 1.0


def test_noisy_votes_still_find_the_objects():
    grid = GRIDS[1]
    tsdf, votes, labels = volumes(*touching(), grid)
    instances, centres = HoughVoting().extract(tsdf, noisy(votes, 1.0, 0.2), grid)
    assert len(centres) == 4
    found = ious(instances, labels)
    assert np.sort(found)[1] > 0.9  # all but the small box between two others
    assert found.min() > 0.5


def test_labels_go_from_large_to_small_and_belong_to_their_centres():
    grid = GRIDS[1]
    tsdf, votes, _ = volumes(*touching(), grid)
    instances, centres = HoughVoting().extract(tsdf, votes, grid)
    sizes = np.bincount(instances.numpy().ravel())[1:]
    assert (np.diff(sizes) <= 0).all()
    points = grid.centres()
    for i, centre in enumerate(centres.numpy(), start=1):
        mean = points[instances.numpy() == i].mean(axis=0)
        assert np.linalg.norm(mean - centre) < grid.voxel_size


def test_lengths_of_votes_do_not_matter():
    grid = GRIDS[0]
    tsdf, votes, _ = volumes(*touching(), grid)
    scale = torch.rand(1, *grid.shape, generator=torch.Generator().manual_seed(0)) + 0.2
    first, _ = HoughVoting().extract(tsdf, votes, grid)
    second, _ = HoughVoting().extract(tsdf, votes * scale, grid)
    assert torch.equal(first, second)


def test_same_input_gives_same_output():
    grid = GRIDS[0]
    tsdf, votes, _ = volumes(*touching(), grid)
    votes = noisy(votes, 1.0, 0.5)
    first = HoughVoting().extract(tsdf, votes, grid)
    second = HoughVoting().extract(tsdf, votes, grid)
    assert torch.equal(first[0], second[0])
    assert torch.equal(first[1], second[1])


@settings(max_examples=15)
@given(
    st.tuples(*[st.floats(-0.15, 0.15)] * 2, st.floats(0.1, 0.3)),
    st.floats(0.04, 0.14),
    st.booleans(),
)
def test_one_convex_object_is_one_instance(centre, size, round_one):
    grid = GRIDS[0]
    centre = np.array(centre)
    part = sphere(centre, size) if round_one else box(centre, np.array([size, 0.6 * size, 0.04]))
    tsdf, votes, labels = volumes([part], [centre], grid)
    instances, centres = HoughVoting().extract(tsdf, votes, grid)
    assert len(centres) == min(1, int((labels > 0).sum()))
    assert torch.equal(instances, labels)


def test_objects_without_votes_are_one_instance():
    grid = GRIDS[0]
    tsdf, votes, labels = volumes(*touching(), grid)
    instances, centres = HoughVoting().extract(tsdf, torch.zeros_like(votes), grid)
    assert len(centres) == 1
    assert torch.equal(instances > 0, labels > 0)


def test_empty_space_has_no_instances():
    grid = GRIDS[0]
    instances, centres = HoughVoting().extract(
        torch.full(grid.shape, 0.1), torch.zeros(3, *grid.shape), grid
    )
    assert not instances.any()
    assert centres.shape == (0, 3)


def test_a_grid_that_is_all_inside_is_survived():
    grid = GRIDS[0]
    votes = torch.randn(3, *grid.shape, generator=torch.Generator().manual_seed(0))
    instances, centres = HoughVoting().extract(torch.full(grid.shape, -0.1), votes, grid)
    assert (instances > 0).all()
    assert len(centres) == int(instances.max())


def test_tiny_instances_are_given_to_others():
    grid = GRIDS[1]
    centres = np.array([[0, 0, 0.1], [0.13, 0, 0.1]])
    parts = [sphere(centres[0], 0.1), sphere(centres[1], 0.03)]
    tsdf, votes, _ = volumes(parts, centres, grid)
    assert len(HoughVoting(smallest=3e-5).extract(tsdf, votes, grid)[1]) == 2
    assert len(HoughVoting(smallest=3e-4).extract(tsdf, votes, grid)[1]) == 1


@pytest.mark.parametrize("bad", ["shape", "votes", "nan"])
def test_bad_input_is_named(bad):
    grid = GRIDS[0]
    tsdf, votes = torch.ones(grid.shape), torch.zeros(3, *grid.shape)
    if bad == "shape":
        tsdf = tsdf[:-1]
    elif bad == "votes":
        votes = votes[None]
    else:
        tsdf[0, 0, 0] = float("nan")
    with pytest.raises(InputError, match="expected"):
        HoughVoting().extract(tsdf, votes, grid)


def test_bad_settings_are_named():
    with pytest.raises(ConfigError, match="bandwidth"):
        HoughVoting(bandwidth=0.0)
