import json

import numba
import numpy as np
import pytest
import torch
from benchmarks.rays import scatter_inverse_rays
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.unit.kernels import analytic

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.inverse_ray_tracing import InverseRayTracing
from scenefw.mapping.projective import Projective

ABOVE = (0.4, 0.2, 1.1)
SIZES = [(32, 160, 120), (64, 320, 240)]


def fuse(view, grid, depth=None, **settings):
    depth = analytic.depth([analytic.BALL], view)[None] if depth is None else depth
    partial = InverseRayTracing(**settings).fuse(depth, grid, stack_cameras([view]))
    return partial.distance[0, 0].numpy(), partial.observed[0, 0].numpy()


@pytest.mark.parametrize(("resolution", "width", "height"), SIZES)
def test_distances_before_the_surface_are_unbiased(resolution, width, height):
    grid, view = GridSpec(resolution=resolution), analytic.camera(ABOVE, width=width, height=height)
    distance, observed = fuse(view, grid)
    exact = analytic.along_rays([analytic.BALL], view, grid)
    inside = analytic.in_image(view, grid)
    near = inside & (exact > 0) & (exact < grid.voxel_size)
    error = (distance - exact)[near] / grid.voxel_size
    assert near.sum() > 500
    assert abs(error.mean()) < 0.06
    assert np.quantile(np.abs(error), 0.9) < 0.1
    band = inside & (exact > 0) & (exact < 0.8 * grid.truncation)
    error = (distance - exact)[band] / grid.voxel_size
    assert np.median(np.abs(error)) < 0.06
    assert np.quantile(np.abs(error), 0.9) < 0.3
    assert observed[band & (exact > 0.3 * grid.voxel_size)].mean() > 0.99


@pytest.mark.parametrize(("resolution", "width", "height"), SIZES)
def test_it_agrees_with_projection_around_the_surface(resolution, width, height):
    grid, view = GridSpec(resolution=resolution), analytic.camera(ABOVE, width=width, height=height)
    depth = analytic.depth(analytic.SCENE, view)[None]
    projected = Projective().fuse(depth, grid, stack_cameras([view]))
    distance, observed = fuse(view, grid, depth)
    expected = projected.distance[0, 0].numpy()
    band = projected.observed[0, 0].numpy() & (np.abs(expected) < 0.8 * grid.truncation)
    error = np.abs(distance - expected)[band] / grid.voxel_size
    assert band.sum() > 2000
    assert np.median(error) < 0.15
    assert np.quantile(error, 0.9) < 0.5
    np.testing.assert_array_equal(observed, projected.observed[0, 0].numpy())


def test_free_space_and_shadows_are_at_the_truncation():
    grid, view = GridSpec(), analytic.camera(width=320, height=240)
    distance, observed = fuse(view, grid)
    exact = analytic.along_rays([analytic.BALL], view, grid)
    inside = analytic.in_image(view, grid)
    far = np.float32(grid.truncation)
    free = inside & (exact > grid.truncation + 0.06) & np.isfinite(exact)
    hidden = inside & (exact < -0.01 - 3 * grid.voxel_size)
    assert (distance[free] == far).mean() > 0.98  # but for a fringe around the silhouette
    assert observed[free].mean() > 0.999
    assert hidden.sum() > 5_000
    assert (distance[hidden] == far).mean() > 0.95
    assert observed[hidden].mean() < 0.01
    assert np.abs(distance).max() <= far


def test_sampling_ends_behind_the_surface():
    """Values reach `behind` and what lies between a sample and the voxels around it, no deeper."""
    grid, view = GridSpec(), analytic.camera(ABOVE, width=320, height=240)
    exact = analytic.along_rays([analytic.BALL], view, grid)
    deep = analytic.in_image(view, grid) & (exact < -0.03 - 1.8 * grid.voxel_size)
    shares = [
        (fuse(view, grid, behind=behind)[0] < 0)[deep].mean() for behind in (0.01, 0.03, 0.07)
    ]
    assert shares[0] < 0.03
    assert shares[1] < 0.06
    assert shares[2] > 0.15


def test_where_surfaces_compete_the_nearest_wins():
    """A wall at 1 m fills the left half of the image, one at 1.13 m the right half."""
    view = analytic.camera((-1.2, 0.0, 0.0), (0.0, 0.0, 0.0), 160, 120)
    grid = GridSpec(resolution=32, lower=(-0.5, -0.5, -0.5))
    depth = torch.full((1, 120, 160), 1.0)
    depth[:, :, 80:] = 1.13
    distance, _ = fuse(view, grid, depth)
    centres = grid.centres()
    # at the seam (y = 0), 10 cm before the far wall, both walls' rays touch the voxels
    seam = (np.abs(centres[..., 1]) < grid.voxel_size) & (np.abs(centres[..., 2]) < 0.3)
    seam &= np.abs(centres[..., 0] + 0.2) < 0.5 * grid.voxel_size
    ray = centres - [-1.2, 0, 0]
    near_wall = (1.0 - ray[..., 0]) * np.linalg.norm(ray, axis=-1) / ray[..., 0]
    left_half = seam & (centres[..., 1] > 0)
    assert seam.sum() >= 2
    np.testing.assert_allclose(distance[left_half], near_wall[left_half], atol=2e-3)
    np.testing.assert_allclose(distance[seam], near_wall[seam], atol=0.4 * grid.voxel_size)


@pytest.mark.parametrize("resolution", [16, 40])
def test_a_wall_is_as_far_as_its_depth_says(resolution):
    grid = GridSpec(resolution=resolution, lower=(-0.5, -0.5, -0.5))
    view = analytic.camera((-1.2, 0.0, 0.0), (0.0, 0.0, 0.0), 240, 240)
    distance, _ = fuse(view, grid, torch.full((1, 240, 240), 1.2))
    ray = grid.centres() - [-1.2, 0.0, 0.0]
    exact = (1.2 - ray[..., 0]) * np.linalg.norm(ray, axis=-1) / ray[..., 0]
    band = (exact > 0) & (exact < 0.9 * grid.truncation)
    band &= (np.abs(grid.centres()[..., 1:]) < 0.2).all(-1)
    error = np.abs(distance - exact)[band] / grid.voxel_size
    assert error.max() < 0.05


@pytest.mark.parametrize(("resolution", "width", "height"), SIZES)
def test_it_equals_the_same_definition_in_scatter_operations(resolution, width, height):
    grid, view = GridSpec(resolution=resolution), analytic.camera(width=width, height=height)
    depth = analytic.depth(analytic.SCENE, view)[None]
    depth[:, ::7] = 0
    expected = scatter_inverse_rays(depth, grid, stack_cameras([view])).numpy()
    distance, _ = fuse(view, grid, depth)
    error = np.abs(distance - expected) / grid.voxel_size
    assert (expected < grid.truncation).sum() > 3000
    assert (error > 1e-3).mean() < 5e-4  # samples that rounding puts into another cell
    assert error.max() < 0.5


@settings(max_examples=15)
@given(st.integers(1, 3), st.floats(0, 2 * np.pi))
def test_a_quarter_turn_turns_the_result(quarters, angle):
    grid = GridSpec(resolution=24)
    view = analytic.camera((0.6 * np.cos(angle), 0.6 * np.sin(angle), 0.9), width=64, height=48)
    turn = np.linalg.matrix_power(
        np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), quarters
    )
    depth = analytic.depth(analytic.SCENE, view)[None].expand(2, -1, -1)
    cameras = stack_cameras([view, view.moved(turn @ view.T_world_camera)])
    partial = InverseRayTracing().fuse(depth, grid, cameras)
    turned = torch.rot90(partial.distance[0], quarters, (1, 2))
    error = (turned - partial.distance[1]).abs() / grid.voxel_size
    assert (error > 0.02).float().mean() < 0.002


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="needs two threads to compare")
def test_the_number_of_threads_changes_no_bit():
    grid, view = GridSpec(resolution=32), analytic.camera(ABOVE, width=160, height=120)
    depth = analytic.depth(analytic.SCENE, view)[None]
    many = fuse(view, grid, depth)[0]
    numba.set_num_threads(1)
    try:
        one = fuse(view, grid, depth)[0]
    finally:
        numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
    np.testing.assert_array_equal(one, many)


def test_scenes_of_a_batch_do_not_meet():
    grid = GridSpec(resolution=16)
    views = [analytic.camera(eye, width=40, height=30) for eye in ((0.8, 0, 0.5), (0, -0.9, 0.3))]
    depth = torch.stack([analytic.depth([analytic.BALL], view) for view in views])
    together = InverseRayTracing().fuse(depth, grid, stack_cameras(views))
    for i, view in enumerate(views):
        distance, observed = fuse(view, grid)
        np.testing.assert_array_equal(together.distance[i, 0], distance)
        np.testing.assert_array_equal(together.observed[i, 0], observed)


@pytest.mark.parametrize("missing", [0.0, float("nan"), float("inf")])
def test_without_a_measurement_nothing_is_observed(missing):
    grid, view = GridSpec(resolution=16), analytic.camera(width=40, height=30)
    distance, observed = fuse(view, grid, torch.full((1, 30, 40), missing))
    np.testing.assert_array_equal(distance, np.float32(grid.truncation))
    assert not observed.any()


@pytest.mark.parametrize("settings", [{"step": 0.0}, {"step": -1.0}, {"behind": -0.01}])
def test_impossible_sampling_is_an_error(settings):
    with pytest.raises(ConfigError, match=next(iter(settings))):
        InverseRayTracing(**settings)


def test_an_image_of_another_size_is_an_error():
    with pytest.raises(InputError, match=r"\(1, 5, 5\)"):
        fuse(analytic.camera(), GridSpec(), torch.ones(1, 5, 5))


def test_real_images_fill_the_cube(real_data):
    """A table seen from a guessed pose: its nearest 1 m is observed, most of it free or surface."""
    listed = json.loads((real_data / "real" / "index.json").read_text())
    assert listed
    files = sorted((real_data / "real" / "mosd_learn").glob("*.npz"))[:3]
    assert len(files) == 3
    for file in files:
        with np.load(file) as stored:
            depth = torch.from_numpy(stored["depth_mm"].astype(np.float32) / 1000)[None]
            k = stored["K"]
        height, width = depth.shape[1:]
        reach = float(depth[depth > 0].median())
        pose = look_at((reach * 0.7, 0.0, reach * 0.7), (0.0, 0.0, 0.05))
        view = Camera(width, height, k[0, 0], k[1, 1], k[0, 2], k[1, 2], pose)
        distance, observed = fuse(view, GridSpec(), depth)
        assert np.isfinite(distance).all()
        assert (np.abs(distance) < 0.078).sum() > 2_000
        assert (distance < 0).any()
        assert 0.02 < observed.mean() < 0.98
