"""What networks of sets are shown of a view: a volume with points, or a small image of places."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import torch
from torch import Tensor, nn

from scenefw.core.errors import InputError
from scenefw.data.batches.conditioning import condition
from scenefw.data.batches.visible_points import LOWEST, seen_points
from scenefw.kernels.cameras import places_of, require_depth
from scenefw.kernels.place_images import cell_points, place_image

if TYPE_CHECKING:
    from scenefw.core.batches import CameraBatch, PartialTSDF
    from scenefw.core.types import GridSpec

EVEN = 32
"""Pixels: sides of images are multiples, so that all maps of a network have whole cells."""
_UNCLEAR = 1e-6


class SetView(NamedTuple):
    """What is shown of B views, and the frame in which a network sees it.

    Volumes are seen in the world. Images are seen in the frame of their view: z is up, the origin
    lies on the floor below the middle of what is seen above it, and x points level away from the
    camera, or to the top of the image where it looks straight down.

    Args:
        condition: what its encoder sees: (B, 2, X, Y, Z) volumes, or (B, 11, H, W) images.
        points: (B, P, 3) m, in the frame.
        seen: (B, P) bool: points that count.
        turn: (B, 3, 3), from the world to the frame.
        origin: (B, 3) m, of the frame in the world.
    """

    condition: Tensor
    points: Tensor
    seen: Tensor
    turn: Tensor
    origin: Tensor


def volume_view(partial: PartialTSDF, grid: GridSpec, chances: Tensor) -> SetView:
    """Volumes and points of the world, for networks that see volumes.

    Args:
        partial: with its images.
        grid: of the partial TSDFs.
        chances: (B, P) uniform in [0, 1), of the points.

    Raises:
        InputError: partial TSDFs without images.
    """
    depth, cameras = _images(partial)
    points, valid = seen_points(depth, cameras, grid, chances.to(depth.device))
    turn = torch.eye(3, device=points.device).expand(len(points), 3, 3)
    origin = points.new_zeros(len(points), 3)
    return SetView(condition(partial, grid), points, valid, turn, origin)


def image_shape(width: int, camera_width: int, camera_height: int) -> tuple[int, int]:
    """Rows and columns of an image of places: near `width` and its camera's shape, in whole cells.

    Args:
        width: pixels that are wanted.
        camera_width: pixels of the camera.
        camera_height: likewise.
    """
    columns = max(round(width / EVEN), 1) * EVEN
    rows = max(round(columns * camera_height / camera_width / EVEN), 1) * EVEN
    return rows, columns


def image_view(partial: PartialTSDF, grid: GridSpec, width: int) -> SetView:
    """An image of places about `width` pixels wide, in the frame of the view.

    Args:
        partial: with its images.
        grid: outside which nothing counts.
        width: pixels; both sides are rounded to multiples of 32 (`image_shape`).

    Raises:
        InputError: partial TSDFs without images, or images that don't fit their cameras.
    """
    depth, cameras = _images(partial)
    depth = require_depth(depth, cameras)
    height, width = image_shape(width, cameras.width, cameras.height)
    rows, columns = (
        ((torch.arange(size, device=depth.device) + 0.5) * (full_size / size)).long()
        for size, full_size in ((height, cameras.height), (width, cameras.width))
    )
    pixels = (rows[:, None] * cameras.width + columns).flatten().expand(len(depth), -1)
    samples = depth.flatten(1).gather(1, pixels)
    places = torch.where((samples > 0)[..., None], places_of(samples, pixels, cameras), torch.nan)
    return view_of_places(places.view(-1, height, width, 3), grid, cameras.T_world_camera)


def view_of_places(places: Tensor, grid: GridSpec, poses: Tensor) -> SetView:
    """A view from an image of places.

    Args:
        places: (B, H, W, 3) m, world, NaN where nothing is measured.
        grid: outside which nothing counts.
        poses: (B, 4, 4) of the cameras, camera to world.
    """
    lower = places.new_tensor(grid.lower)
    inside = ((places > lower) & (places < lower + grid.extent)).all(dim=-1)
    above = inside & (places[..., 2] > LOWEST)
    spots = torch.where(above[..., None], places, 0.0).flatten(1, 2)
    middle = spots.sum(dim=1) / above.flatten(1).sum(dim=1, keepdim=True).clamp_min(1)
    origin = middle * middle.new_tensor([1.0, 1.0, 0.0])
    turn = _level(poses)
    local = torch.einsum("bij,bhwj->bhwi", turn, places - origin[:, None, None])
    points, valid = cell_points(local, above)
    return SetView(place_image(local, above), points, valid, turn, origin)


def _level(poses: Tensor) -> Tensor:
    """Turns (B, 3, 3) from the world to frames whose x is level, along the view.

    Forward and up in the image, added, are level along the view from the horizon to straight down.
    """
    ahead = (poses[:, :2, 2] - poses[:, :2, 1]).float()
    unclear = torch.linalg.vector_norm(ahead, dim=-1, keepdim=True) < _UNCLEAR
    x, y = nn.functional.normalize(
        torch.where(unclear, ahead.new_tensor([1.0, 0.0]), ahead), dim=-1
    ).unbind(dim=-1)
    zero, unit = torch.zeros_like(x), torch.ones_like(x)
    rows = [torch.stack([x, y, zero], -1), torch.stack([-y, x, zero], -1),
            torch.stack([zero, zero, unit], -1)]  # fmt: skip
    return torch.stack(rows, dim=1)


def _images(partial: PartialTSDF) -> tuple[Tensor, CameraBatch]:
    if partial.depth is None or partial.cameras is None:
        raise InputError(
            "decoders of sets look at depth images, and a partial TSDF came without; fuse views by "
            "something that keeps them"
        )
    return partial.depth, partial.cameras
