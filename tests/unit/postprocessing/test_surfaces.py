import numpy as np
import pytest
import torch
import trimesh
from scipy import ndimage
from tests.unit.postprocessing.stacks import sphere, touching, volumes

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.postprocessing.surfaces import instance_meshes, surface

GRIDS = [GridSpec(resolution=32), GridSpec(resolution=64)]


def solid(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces)


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: str(grid.resolution))
def test_a_ball_has_its_area_and_volume_where_it_is(grid):
    centre, radius = np.array([0.05, -0.03, 0.2]), 0.12
    mesh = solid(surface(sphere(centre, radius)(grid.centres()), grid))
    assert mesh.is_watertight
    error = (grid.voxel_size / radius) ** 2
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=error)  # > 0: outwards
    assert mesh.area == pytest.approx(4 * np.pi * radius**2, rel=error)
    np.testing.assert_allclose(mesh.center_mass, centre, atol=0.02 * grid.voxel_size)
    distances = np.linalg.norm(mesh.vertices - centre, axis=1)
    np.testing.assert_allclose(distances, radius, atol=0.1 * grid.voxel_size)


def test_nothing_inside_gives_no_surface():
    grid = GRIDS[0]
    assert surface(torch.ones(grid.shape), grid) is None
    assert instance_meshes(torch.ones(grid.shape), torch.zeros(grid.shape).int(), grid) == {}


def test_what_leaves_the_grid_is_closed_at_its_border():
    grid = GRIDS[0]
    mesh = solid(surface(sphere(np.array(grid.lower), 0.3)(grid.centres()), grid))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.3**3 / 8, rel=0.1)


@pytest.mark.parametrize("grid", GRIDS, ids=lambda grid: str(grid.resolution))
def test_touching_objects_get_watertight_meshes_of_their_own(grid):
    tsdf, _, labels = volumes(*touching(), grid)
    meshes = instance_meshes(tsdf, labels, grid)
    assert sorted(meshes) == [1, 2, 3, 4]
    for label, mesh in meshes.items():
        assert solid(mesh).is_watertight
        voxels = int((labels == label).sum()) * grid.voxel_size**3
        assert solid(mesh).volume == pytest.approx(
            voxels, rel=0.15 if grid.resolution == 64 else 0.4
        )
    total = sum(solid(mesh).volume for mesh in meshes.values())
    assert total == pytest.approx(solid(surface(tsdf, grid)).volume, rel=0.05)


def test_the_border_between_halves_of_a_ball_is_flat():
    grid, centre, radius = GRIDS[1], np.array([0, 0, 0.2]), 0.15
    points = grid.centres()
    tsdf = sphere(centre, radius)(points)
    slanted = (points - centre) @ np.array([0.6, 0.48, 0.64])
    labels = np.where(tsdf < 0, np.where(slanted > 0, 2, 1), 0)
    mesh = instance_meshes(tsdf, labels, grid)[1]
    inner = np.linalg.norm(mesh.vertices - centre, axis=1) < 0.8 * radius
    heights = (mesh.vertices[inner] - centre) @ np.array([0.6, 0.48, 0.64])
    assert inner.sum() > 50
    assert heights.std() < 0.3 * grid.voxel_size  # voxel faces would give 0.5 and more
    halves = [solid(m).volume for m in instance_meshes(tsdf, labels, grid).values()]
    assert halves[0] == pytest.approx(halves[1], rel=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_random_fields_cut_anywhere_stay_watertight(seed):
    grid, rng = GRIDS[0], np.random.default_rng(seed)
    tsdf = 0.1 * ndimage.gaussian_filter(rng.normal(size=grid.shape), 1.2)
    tsdf[rng.random(grid.shape) < 0.01] = 0.0  # zeros at voxel centres make faces degenerate
    blocks = rng.integers(1, 4, (4, 4, 4)).repeat(8, 0).repeat(8, 1).repeat(8, 2)
    labels = np.where(tsdf < 0, blocks, 0)
    assert solid(surface(tsdf, grid)).is_watertight
    for mesh in instance_meshes(tsdf, labels, grid).values():
        assert solid(mesh).is_watertight
        assert solid(mesh).volume > 0


def test_a_voxel_among_others_keeps_a_mesh():
    grid = GRIDS[0]
    tsdf, _, labels = volumes([sphere(np.array([0, 0, 0.2]), 0.2)], np.array([[0, 0, 0.2]]), grid)
    middle = tuple(np.round(grid.to_voxels(np.array([0, 0, 0.2]))).astype(int))
    labels[middle] = 2
    assert solid(instance_meshes(tsdf, labels, grid)[2]).is_watertight


def test_bad_input_is_named():
    grid = GRIDS[0]
    with pytest.raises(InputError, match="shape"):
        surface(torch.ones(1, *grid.shape), grid)
    with pytest.raises(InputError, match="NaN"):
        surface(torch.full(grid.shape, float("nan")), grid)
    with pytest.raises(InputError, match="instances"):
        instance_meshes(torch.ones(grid.shape), torch.zeros(2, 2, 2), grid)
