"""Windows about objects: they hold them, and their cameras see the places of the image."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.batches import CameraBatch
from scenefw.core.part_views import PartViewBatch
from scenefw.kernels.cameras import pixel_places
from scenefw_things.shells.crops import crop, references, windows

WIDTH, HEIGHT = 40, 30


def views():
    """A box of 8 x 6 pixels before a wall; depth says which column and row a pixel has."""
    depth = 1 + 0.01 * torch.arange(WIDTH) + 0.001 * torch.arange(HEIGHT)[:, None]
    owners = torch.zeros(HEIGHT, WIDTH, dtype=torch.int32)
    owners[10:16, 20:28] = 3
    owners[2:5, 2:5] = 7
    depth[15, 27] = 0
    lens = torch.tensor([[50.0, 55.0, 19.0, 14.0]])
    pose = torch.eye(4)
    pose[:3, 3] = torch.tensor([0.3, -0.2, 0.9])
    cameras = CameraBatch(WIDTH, HEIGHT, lens, pose[None])
    colour = torch.rand(1, 3, HEIGHT, WIDTH, generator=torch.Generator().manual_seed(0))
    return PartViewBatch(depth[None], owners[None], cameras, None, colour)


def square(margin=1.5, shift=(0.0, 0.0), min_side=1.0):
    mask = (views().owners == 3) & (views().depth > 0)
    numbers = torch.tensor([margin]), torch.tensor([shift]), torch.tensor([min_side])
    return windows(mask, *numbers)


def test_windows_lie_about_what_is_visible():
    assert square().tolist() == [[18.0, 7.0, 12.0]]
    assert square(min_side=20.0).tolist() == [[14.0, 3.0, 20.0]]
    assert square(shift=(0.5, -0.5)).tolist() == [[24.0, 1.0, 12.0]]


def test_a_crop_of_the_images_own_pixels_is_a_part_of_it():
    image, box = views(), crop(views(), torch.tensor([0]), torch.tensor([3]), square(), 12)
    window = np.s_[:, 7:19, 18:30]
    assert torch.equal(box.depth, image.depth[window])
    assert torch.equal(box.visible, (image.owners == 3)[window] & (image.depth > 0)[window])
    assert not box.others.any()
    assert torch.equal(box.colour, image.colour[:, :, 7:19, 18:30])
    places = pixel_places(image.depth, image.cameras)[window]
    torch.testing.assert_close(pixel_places(box.depth, box.cameras), places)


@given(
    resolution=st.integers(5, 50),
    margin=st.floats(1.0, 6.0),
    shift=st.tuples(*[st.floats(-0.4, 0.4)] * 2),
)
def test_rays_of_a_crop_pass_the_pixels_that_they_show(resolution, margin, shift):
    image = views()
    box = crop(image, torch.tensor([0]), torch.tensor([3]), square(margin, shift), resolution)
    local = pixel_places(box.depth, box.cameras) - image.cameras.T_world_camera[0, :3, 3]
    shown = box.depth > 0
    fx, fy, cx, cy = image.cameras.intrinsics[0].tolist()
    column = local[..., 0] / box.depth * fx + cx
    row = local[..., 1] / box.depth * fy + cy
    expected = 1 + 0.01 * column.round() + 0.001 * row.round()
    exact = ((column % 1 - 0.5).abs() > 1e-3) & ((row % 1 - 0.5).abs() > 1e-3) & shown
    torch.testing.assert_close(box.depth[exact], expected[exact], atol=1e-4, rtol=0)
    beside = (column < -0.51) | (column > WIDTH - 0.49) | (row < -0.51) | (row > HEIGHT - 0.49)
    assert not (shown & beside).any()


def test_the_reference_is_what_is_visible():
    box = crop(views(), torch.tensor([0]), torch.tensor([3]), square(), 12)
    depth, width = references(box)
    values = box.depth[box.visible]
    assert float(depth) == float(values.median())
    assert float(width) == pytest.approx(float(depth) * 12 / 50)
    nothing = crop(views(), torch.tensor([0]), torch.tensor([9]), square(), 12)
    assert references(nothing)[0].tolist() == [1.0]
