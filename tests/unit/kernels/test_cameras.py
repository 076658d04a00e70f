import numpy as np
import pytest
import torch
from tests.unit.kernels import analytic

from scenefw.core.errors import InputError
from scenefw.core.geometry import look_at, transform_points
from scenefw.core.types import Camera
from scenefw.kernels.cameras import floor_depths, require_depth, stack_cameras


def test_a_batch_holds_every_camera():
    cameras = [analytic.camera((0.8, 0.1, 0.5)), analytic.camera((-0.3, 0.9, 0.2))]
    batch = stack_cameras(cameras)
    assert (batch.width, batch.height) == (320, 240)
    for i, camera in enumerate(cameras):
        expected = [camera.fx, camera.fy, camera.cx, camera.cy]
        np.testing.assert_allclose(batch.intrinsics[i], expected, rtol=1e-6)
        np.testing.assert_allclose(batch.T_world_camera[i], camera.T_world_camera, atol=1e-6)


def _with_pose(change):
    pose = np.eye(4)
    change(pose)
    return Camera(T_world_camera=pose)


@pytest.mark.parametrize(
    ("cameras", "words"),
    [
        ([], "no camera"),
        ([Camera(), Camera(width=320)], "one image size"),
        ([Camera(fx=0.0)], "focal"),
        ([Camera(cx=float("nan"))], "unusable"),
        ([Camera(T_world_camera=2 * np.eye(4))], "rotation"),
        ([_with_pose(lambda pose: pose.__setitem__((0, 3), np.nan))], "finite"),
        ([Camera(T_world_camera=np.eye(3))], "4x4"),
    ],
)
def test_unusable_cameras_are_named(cameras, words):
    with pytest.raises(InputError, match=words) as error:
        stack_cameras(cameras)
    assert "\n" not in str(error.value)


def test_depth_of_another_size_than_its_camera_is_an_error():
    batch = stack_cameras([analytic.camera()])
    with pytest.raises(InputError, match=r"\(1, 240, 319\)"):
        require_depth(torch.zeros(1, 240, 319), batch)


def test_depth_without_a_finite_value_is_no_measurement():
    batch = stack_cameras([analytic.camera(width=4, height=3)])
    depth = torch.ones(1, 3, 4)
    depth[0, 0, :3] = torch.tensor([float("nan"), float("inf"), -float("inf")])
    clean = require_depth(depth, batch)
    assert clean[0, 0].tolist() == [0, 0, 0, 1]
    assert (clean[0, 1:] == 1).all()


@pytest.mark.parametrize("size", [(40, 30), (64, 48)])
def test_points_at_the_depth_of_the_floor_lie_on_it(size):
    eyes = [(0.8, 0.1, 0.7), (-0.3, 0.5, 1.1)]
    cameras = [Camera(T_world_camera=look_at(eye, (0.0, 0.0, 0.05))).resized(*size) for eye in eyes]
    depths = floor_depths(stack_cameras(cameras)).double().numpy()
    assert depths.shape == (2, size[1], size[0])
    v, u = np.mgrid[: size[1], : size[0]]
    for camera, depth in zip(cameras, depths, strict=True):
        local = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1 + 0 * u], -1)
        points = transform_points(camera.T_world_camera, depth[..., None] * local)
        assert np.abs(points[..., 2]).max() < 1e-5


def test_rays_above_the_horizon_end_far_away():
    level = Camera(T_world_camera=look_at((0.0, 0.0, 0.5), (1.0, 0.0, 0.5))).resized(40, 30)
    depths = floor_depths(stack_cameras([level]), level=0.1)
    assert depths[0, 0].unique().tolist() == pytest.approx([5.0])
