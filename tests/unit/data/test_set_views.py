"""What decoders of sets are shown of views: images in the frames of their cameras."""

import numpy as np
import pytest
import torch

from scenefw.core.batches import PartialTSDF
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.data.seen_points import LOWEST
from scenefw.data.set_views import image_view, volume_view
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


@pytest.mark.parametrize(("width", "shape"), [(128, (96, 128)), (64, (64, 64)), (100, (64, 96))])
def test_images_keep_their_shape_and_have_whole_cells(width, shape):
    view = image_view(turned(0.3), GRID, width)
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
    eye = seen_from.cameras.T_world_camera[:, :3, 3]
    ahead = torch.einsum("bij,bj->bi", view.turn, view.origin - eye)[0]
    assert ahead[0] > 0.5
    assert abs(ahead[1]) < 1e-5


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
        with pytest.raises(ValueError, match="depth images"):
            made(PartialTSDF(nothing, nothing > 0))
