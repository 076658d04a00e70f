"""What decoders of sets are shown of views: images in the frames of their cameras."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from scenefw.core.batches import PartialTSDF
from scenefw.core.errors import InputError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.data.batches.set_inputs import image_view, volume_view
from scenefw.data.batches.visible_points import LOWEST
from scenefw.kernels.cameras import pixel_places, stack_cameras

GRID = GridSpec(16)


def turned(angle, width=640, height=480):
    """A camera that looks at the origin from an angle about z, and its depth of a raised plate."""
    eye = (0.9 * np.cos(angle), 0.9 * np.sin(angle), 0.7)
    focal = 0.9 * width
    camera = Camera(
        width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, look_at(eye, (0, 0, 0))
    )
    cameras = stack_cameras([camera])
    rows, columns = np.mgrid[:height, :width]
    rays = np.stack([(columns - camera.cx) / focal, (rows - camera.cy) / focal, np.ones_like(rows)],
                    axis=-1) @ camera.T_world_camera[:3, :3].T  # fmt: skip
    plate = -(0.7 - 0.1) / rays[..., 2]
    at = camera.T_world_camera[:3, 3] + plate[..., None] * rays
    # A plate that isn't the same from all sides, about the same places as seen from the camera
    forth = at[..., 0] * np.cos(angle) + at[..., 1] * np.sin(angle)
    side = -at[..., 0] * np.sin(angle) + at[..., 1] * np.cos(angle)
    on_plate = (np.abs(forth - 0.05) < 0.1) & (np.abs(side + 0.02) < 0.06)
    depth = np.where(on_plate, plate, -0.7 / rays[..., 2])
    nothing = torch.zeros(1, 1, *GRID.shape)
    return PartialTSDF(nothing, nothing > 0, torch.from_numpy(depth).float()[None], cameras)


@pytest.mark.parametrize(("size", "width", "shape"), [
    ((640, 480), 128, (96, 128)), ((640, 480), 64, (64, 64)), ((640, 480), 100, (64, 96)),
    ((640, 360), 128, (64, 128)), ((320, 320), 128, (128, 128)), ((240, 320), 96, (128, 96)),
])  # fmt: skip
def test_images_keep_about_their_shape_and_have_whole_cells(size, width, shape):
    view = image_view(turned(0.3, *size), GRID, width)
    assert view.seen.any()
    assert view.condition.shape[-2:] == shape
    assert view.points.shape == (1, shape[0] * shape[1] // 16, 3)


def test_frames_look_the_same_from_wherever_the_same_is_seen():
    """What is seen, and the camera, are turned about z together: nothing changes in the frame."""
    first, second = (image_view(turned(angle), GRID, 128) for angle in (0.2, 2.5))
    assert torch.allclose(first.condition, second.condition, atol=2e-3)
    assert torch.allclose(first.points, second.points, atol=2e-3)
    assert torch.equal(first.seen, second.seen)
    back = [
        torch.einsum("bij,bpi->bpj", view.turn, view.points) + view.origin[:, None]
        for view in (first, second)
    ]
    assert (back[0] - back[1])[first.seen].norm(dim=-1).min() > 0.02


def test_points_are_places_of_pixels_in_the_world():
    seen_from = turned(1.0)
    view = image_view(seen_from, GRID, 128)
    world = torch.einsum("bij,bpi->bpj", view.turn, view.points) + view.origin[:, None]
    every = pixel_places(seen_from.depth, seen_from.cameras).flatten(1, 2)
    gaps = torch.cdist(world[view.seen][None], every).amin(dim=-1)
    assert gaps.max() < 2e-4
    assert (view.points[view.seen][:, 2] > LOWEST).all()
    middle = every[every[..., 2] > LOWEST].mean(dim=0)
    assert torch.allclose(view.origin[0, :2], middle[:2], atol=0.005)
    assert view.origin[0, 2] == 0
    ahead = view.turn[0] @ seen_from.cameras.T_world_camera[0, :3, 2]
    assert ahead[0] > 0.5
    assert abs(ahead[1]) < 1e-5


@pytest.mark.parametrize("down", [(0.0, 0.0, -1.0), (0.0, 1e-4, -1.0)])
@pytest.mark.parametrize("measured", [0.0, 0.7])
def test_a_camera_that_looks_straight_down_has_a_frame(down, measured):
    """Its x is the top of the image, which looks away from a camera that is tilted a little."""
    pose = np.eye(4)
    pose[:3, 2] = down / np.linalg.norm(down)
    pose[:3, 0] = [1.0, 0.0, 0.0]
    pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    pose[:3, 3] = [0.0, 0.0, 0.8]
    cameras = stack_cameras([Camera(64, 64, 60.0, 60.0, 31.5, 31.5, pose)])
    nothing = torch.zeros(1, 1, *GRID.shape)
    depth = torch.full((1, 64, 64), measured)
    view = image_view(PartialTSDF(nothing, nothing > 0, depth, cameras), GRID, 64)
    assert torch.allclose(torch.linalg.det(view.turn), torch.ones(1))
    assert torch.allclose(view.turn[0, 0], torch.tensor([0.0, 1.0, 0.0]), atol=1e-3)
    assert view.seen.any() == (measured > 0)


def test_what_is_not_measured_is_not_seen():
    view = turned(0.0)
    bare = image_view(PartialTSDF(view.distance, view.observed, 0 * view.depth, view.cameras),
                      GRID, 64)  # fmt: skip
    assert not bare.seen.any()
    assert torch.isfinite(bare.condition).all()
    assert not bare.condition.any()


def test_volumes_stay_in_the_world():
    view = volume_view(turned(0.5), GRID, torch.rand(1, 40))
    assert view.condition.shape == (1, 2, *GRID.shape)
    assert torch.equal(view.turn[0], torch.eye(3))
    assert not view.origin.any()
    assert (view.points[view.seen][:, 2] > LOWEST).all()


def test_views_without_images_are_refused():
    nothing = torch.zeros(1, 1, *GRID.shape)
    for made in (lambda one: image_view(one, GRID, 64),
                 lambda one: volume_view(one, GRID, torch.rand(1, 4))):  # fmt: skip
        with pytest.raises(InputError, match="depth images") as caught:
            made(PartialTSDF(nothing, nothing > 0))
        assert "\n" not in str(caught.value)
    seen = turned(0.1)
    with pytest.raises(InputError, match="cameras"):
        image_view(replace(seen, depth=seen.depth[:, ::2]), GRID, 64)
