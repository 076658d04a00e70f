import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core import geometry
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import Camera, Frame, GridSpec, Pose

resolutions = st.integers(2, 12)


@given(resolutions, st.floats(0.1, 3))
def test_voxels_and_world_are_inverse(resolution, extent):
    grid = GridSpec(resolution, extent, (-0.3, 0.1, 0.0))
    indices = np.stack(np.indices(grid.shape), axis=-1)
    np.testing.assert_allclose(grid.to_world(indices), grid.centres(), atol=1e-12)
    np.testing.assert_allclose(grid.to_voxels(grid.centres()), indices, atol=1e-9)


def test_the_nearest_voxel_of_a_point_is_the_one_that_it_is_in():
    grid = GridSpec(resolution=8)
    indices = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1)
    moved = grid.centres() + 0.4 * grid.voxel_size * np.array([1.0, -1.0, 1.0])
    voxels, there = grid.nearest_voxels(moved)
    assert np.array_equal(voxels, indices)
    assert there.all()
    outside = np.array([[0.0, 0.0, 99.0], np.array(grid.lower) - grid.voxel_size])
    assert not grid.nearest_voxels(outside)[1].any()


@given(resolutions)
def test_centres_fill_the_cube_evenly(resolution):
    grid = GridSpec(resolution)
    centres = grid.centres()
    lower = np.array(grid.lower)
    np.testing.assert_allclose(centres.mean(axis=(0, 1, 2)), lower + grid.extent / 2, atol=1e-12)
    np.testing.assert_allclose(centres[0, 0, 0], lower + grid.voxel_size / 2, atol=1e-12)
    assert centres[1, 0, 0][0] - centres[0, 0, 0][0] == pytest.approx(grid.voxel_size)


def test_the_floor_of_the_default_grid_lies_as_the_conventions_say():
    grid = GridSpec()
    assert grid.shape == (64, 64, 64)
    assert grid.lower[2] == -0.096
    assert grid.truncation == pytest.approx(5 / 64)


def test_grids_of_lists_and_of_tuples_are_equal():
    assert GridSpec(lower=[-0.5, -0.5, -0.096]) == GridSpec()
    assert hash(GridSpec(lower=[-0.5, -0.5, -0.096])) == hash(GridSpec())


@pytest.mark.parametrize(
    "wrong", [{"resolution": 0}, {"extent": -1.0}, {"truncation_voxels": float("nan")}]
)
def test_impossible_grids_are_refused(wrong):
    with pytest.raises(ConfigError, match="not a voxel grid"):
        GridSpec(**wrong)


@given(st.integers(0, 1000))
def test_a_pose_is_its_matrix(seed):
    rng = np.random.default_rng(seed)
    pose = Pose(rng.normal(size=3), geometry.random_quaternion(rng))
    again = Pose.from_matrix(pose.matrix)
    np.testing.assert_allclose(again.matrix, pose.matrix, atol=1e-7)


@given(st.integers(1, 900), st.integers(1, 900), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_a_resized_camera_sees_the_same_rays(width, height, x, y):
    camera = Camera()
    small = camera.resized(width, height)
    u, v = camera.fx * x + camera.cx, camera.fy * y + camera.cy
    share_u, share_v = (u + 0.5) / camera.width, (v + 0.5) / camera.height
    np.testing.assert_allclose(small.fx * x + small.cx, share_u * width - 0.5, atol=1e-6)
    np.testing.assert_allclose(small.fy * y + small.cy, share_v * height - 0.5, atol=1e-6)


def test_the_default_camera_has_45_degrees_of_height():
    camera = Camera()
    angle = 2 * np.degrees(np.arctan(camera.height / 2 / camera.fy))
    assert angle == pytest.approx(45, abs=0.05)
    np.testing.assert_allclose(camera.matrix @ [0, 0, 1], [319.5, 239.5, 1])


def test_a_frame_of_another_size_than_its_camera_is_refused():
    with pytest.raises(InputError, match="480 x 640"):
        Frame(np.zeros((10, 10), np.float32), Camera())


@given(middle=st.floats(-0.8, 0.8), size=st.floats(0.0, 0.4), resolution=st.sampled_from([32, 64]))
def test_a_box_about_points_holds_all_voxels_within_the_truncation(middle, size, resolution):
    grid = GridSpec(resolution=resolution)
    ends = np.array([[middle - size, -0.1, 0.0], [middle + size, 0.1, 0.1]])
    inside = np.zeros(grid.shape, bool)
    inside[grid.box_about(ends)] = True
    reach = grid.truncation
    near = ((grid.centres() > ends[0] - reach) & (grid.centres() < ends[1] + reach)).all(axis=-1)
    assert inside[near].all()
    wider = reach + 2 * grid.voxel_size
    far = ((grid.centres() < ends[0] - wider) | (grid.centres() > ends[1] + wider)).any(axis=-1)
    assert not inside[far].any()


def test_a_grid_that_no_memory_holds_is_refused():
    assert GridSpec(resolution=1024).shape == (1024, 1024, 1024)
    with pytest.raises(ConfigError, match=r"100000 voxels per side .* at most 1024"):
        GridSpec(resolution=100_000)
