from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera
from scenefw.kernels.cameras import stack_cameras
from scenefw.labelling.network_inputs import distance_images
from scenefw.labelling.table_planes import heights_above_planes, table_planes

SIZES = [(96, 72), (160, 120)]


def table(size, eye=(0.1, -0.05, 0.35), boxes=()):
    """Depth of a table with boxes by an independent formula, its camera, and true heights."""
    camera = Camera().resized(*size).moved(look_at(eye, (0.02, 0.01, 0.0)))
    v, u = np.mgrid[: size[1], : size[0]]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.matrix).T
    rays = rays @ camera.T_world_camera[:3, :3].T
    eye = camera.T_world_camera[:3, 3]
    depth, heights = -eye[2] / rays[..., 2], np.zeros(rays.shape[:2])
    for low, high, top in boxes:  # their upper sides alone
        here = (top - eye[2]) / rays[..., 2]
        place = eye[:2] + here[..., None] * rays[..., :2]
        inside = ((place > low) & (place < high)).all(-1)
        depth[inside], heights[inside] = here[inside], top
    return torch.from_numpy(depth)[None].float(), stack_cameras([camera]), heights


@pytest.mark.parametrize("size", SIZES)
@given(st.floats(-np.pi, np.pi), st.floats(0.0, 0.25), st.floats(0.2, 0.5))
def test_the_plane_of_an_empty_table_is_exact(size, angle, aside, height):
    eye = (aside * np.cos(angle), aside * np.sin(angle), height)
    depth, cameras, _ = table(size, eye)
    assert heights_above_planes(depth, cameras).abs().max() < 3e-4


@pytest.mark.parametrize("size", SIZES)
def test_heights_are_true_though_objects_cover_half_of_the_image(size):
    boxes = [((-0.2, -0.2), (0.02, 0.2), 0.03), ((0.05, -0.1), (0.1, 0.1), 0.008)]
    depth, cameras, heights = table(size, boxes=boxes)
    assert (heights > 0).mean() > 0.5
    found = heights_above_planes(depth, cameras)[0].numpy()
    np.testing.assert_allclose(found, heights, atol=1e-3)  # blocks mix at borders


def test_noise_of_depth_moves_the_plane_by_a_fraction_of_it():
    depth, cameras, _ = table((320, 240), boxes=[((0.0, -0.1), (0.08, 0.1), 0.03)])
    rng = np.random.default_rng(0)
    exact = table_planes(depth, cameras)
    for sigma in (0.002, 0.005):
        noise = torch.from_numpy(rng.normal(0, sigma, depth.shape)).float()
        found = table_planes(depth + noise, cameras)
        distance = (1 / found.norm() - 1 / exact.norm()).abs()
        assert distance < 0.2 * sigma


def test_poses_are_not_read():
    depth, cameras, heights = table((96, 72), boxes=[((0.0, 0.0), (0.1, 0.1), 0.02)])
    wrong = cameras.T_world_camera.clone()
    wrong[:, 2, 3] += 0.05
    moved = replace(cameras, T_world_camera=wrong)
    found = distance_images(depth, moved, "plane_height")
    torch.testing.assert_close(found, distance_images(depth, cameras, "plane_height"))
    by_pose = distance_images(depth, moved, "height")[0].numpy()
    np.testing.assert_allclose(by_pose, heights + 0.05, atol=1e-4)


def test_images_of_a_batch_are_apart_and_one_without_measurements_has_no_plane():
    depth, cameras, _ = table((96, 72), boxes=[((0.0, 0.0), (0.1, 0.1), 0.02)])
    other, other_cameras, _ = table((96, 72), eye=(0.0, 0.1, 0.3))
    many = torch.cat([depth, torch.zeros_like(depth), other])
    poses = torch.cat([cameras.T_world_camera] * 2 + [other_cameras.T_world_camera])
    lenses = cameras.intrinsics.expand(3, -1)
    found = table_planes(many, replace(cameras, intrinsics=lenses, T_world_camera=poses))
    assert found[1].isnan().all()
    torch.testing.assert_close(found[:1], table_planes(depth, cameras))
    torch.testing.assert_close(found[2:], table_planes(other, other_cameras))


def test_holes_are_no_points():
    depth, cameras, heights = table((160, 120), boxes=[((0.0, -0.1), (0.08, 0.1), 0.03)])
    depth[:, ::3, ::2] = 0
    depth[:, 40:60] = torch.nan
    found = distance_images(depth, cameras, "plane_height")[0].numpy()
    known = np.isfinite(found)
    assert 0.3 < known.mean() < 0.75
    np.testing.assert_allclose(found[known], heights[known], atol=1e-3)
