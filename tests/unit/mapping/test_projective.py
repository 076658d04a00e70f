import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.kernels import analytic

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.projective import Projective

SIZES = [(32, 160, 120), (64, 320, 240)]


def fuse(view, grid, depth=None):
    depth = analytic.depth([analytic.BALL], view)[None] if depth is None else depth
    partial = Projective().fuse(depth, grid, stack_cameras([view]))
    return partial.distance[0, 0].numpy(), partial.observed[0, 0].numpy()


@pytest.mark.parametrize(("resolution", "width", "height"), SIZES)
@pytest.mark.parametrize("eye", [(0.5, 0.3, 1.0), (0.8, 0.3, 0.6)])
def test_distances_run_along_the_rays_of_the_voxels(resolution, width, height, eye):
    grid, view = GridSpec(resolution=resolution), analytic.camera(eye, width=width, height=height)
    distance, observed = fuse(view, grid)
    exact = analytic.along_rays([analytic.BALL], view, grid)
    band = analytic.in_image(view, grid) & (np.abs(exact) < 0.9 * grid.truncation)
    assert band.sum() > 2000
    error = np.abs(distance - exact)[band] / grid.voxel_size
    assert np.median(error) < 0.1
    assert np.quantile(error, 0.95) < 0.4  # half a pixel aside, at the edge of the ball
    before = observed[band & (exact > 0.3 * grid.voxel_size)]
    behind = observed[band & (exact < -1.3 * grid.voxel_size)]
    assert before.mean() > 0.99
    assert behind.mean() < 0.02


def test_free_space_is_seen_and_the_shadow_is_not():
    grid, view = GridSpec(), analytic.camera(width=320, height=240)
    distance, observed = fuse(view, grid)
    exact = analytic.along_rays([analytic.BALL], view, grid)
    inside = analytic.in_image(view, grid)
    free = inside & (exact > grid.truncation + 0.05) & np.isfinite(exact)
    hidden = inside & (exact < -grid.truncation - 0.05)
    assert free.sum() > 10_000
    assert hidden.sum() > 5_000
    far = np.float32(grid.truncation)
    assert (distance[free] == far).mean() > 0.999
    assert observed[free].mean() > 0.999
    assert (distance[hidden] == far).mean() > 0.98  # but for the far side of its silhouette
    assert observed[hidden].mean() < 0.005
    np.testing.assert_array_equal(distance[~inside], far)
    assert not observed[~inside].any()


@pytest.mark.parametrize("missing", [0.0, float("nan"), float("inf")])
def test_without_a_measurement_nothing_is_observed(missing):
    grid, view = GridSpec(resolution=16), analytic.camera(width=40, height=30)
    distance, observed = fuse(view, grid, torch.full((1, 30, 40), missing))
    np.testing.assert_array_equal(distance, np.float32(grid.truncation))
    assert not observed.any()


def test_voxels_behind_the_camera_are_unseen():
    grid = GridSpec(resolution=16)
    view = analytic.camera((0.0, 0.0, 0.3), (0.5, 0.0, 0.3), 64, 48)
    distance, observed = fuse(view, grid, torch.full((1, 48, 64), 0.2))
    behind = grid.centres()[..., 0] < 0
    np.testing.assert_array_equal(distance[behind], np.float32(grid.truncation))
    assert not observed[behind].any()
    assert observed[~behind].any()


@given(st.floats(0.3, 2.0), st.integers(8, 24))
def test_a_wall_is_as_far_as_its_depth_says(wall, resolution):
    """A camera on the x axis facing a wall: distance / ray length = gap / x on every ray."""
    grid = GridSpec(resolution=resolution, lower=(-0.5, -0.5, -0.5))
    view = analytic.camera((-1.2, 0.0, 0.0), (0.0, 0.0, 0.0), 64, 64)
    distance, observed = fuse(view, grid, torch.full((1, 64, 64), wall))
    ray = grid.centres() - [-1.2, 0.0, 0.0]
    exact = (wall - ray[..., 0]) * np.linalg.norm(ray, axis=-1) / ray[..., 0]
    seen = analytic.in_image(view, grid)
    cut = np.where(exact > -grid.truncation, np.minimum(exact, grid.truncation), grid.truncation)
    sure = seen & (np.abs(exact + grid.truncation) > 1e-4)
    np.testing.assert_allclose(distance[sure], cut[sure], atol=1e-4)
    sure = seen & (np.abs(exact + grid.voxel_size) > 1e-4)
    np.testing.assert_array_equal(observed[sure], (exact > -grid.voxel_size)[sure])


def test_scenes_of_a_batch_do_not_meet():
    grid = GridSpec(resolution=16)
    views = [analytic.camera(eye, width=40, height=30) for eye in ((0.8, 0, 0.5), (0, -0.9, 0.3))]
    depth = torch.stack([analytic.depth([analytic.BALL], view) for view in views])
    together = Projective().fuse(depth, grid, stack_cameras(views))
    assert together.distance.shape == (2, 1, 16, 16, 16)
    for i, view in enumerate(views):
        distance, observed = fuse(view, grid)
        np.testing.assert_array_equal(together.distance[i, 0], distance)
        np.testing.assert_array_equal(together.observed[i, 0], observed)


def test_an_image_of_another_size_is_an_error():
    with pytest.raises(InputError, match=r"\(1, 5, 5\)"):
        fuse(analytic.camera(), GridSpec(), torch.ones(1, 5, 5))
