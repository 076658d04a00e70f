"""What networks of sets are shown of a view: a volume with points, or a small image of places."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import torch
from torch import Tensor

from scenefw.data.conditioning import condition
from scenefw.data.seen_points import LOWEST, seen_points
from scenefw.data.view_frames import view_frame
from scenefw.kernels.cameras import places_of
from scenefw.kernels.place_images import cell_points, place_image

if TYPE_CHECKING:
    from scenefw.core.batches import CameraBatch, PartialTSDF
    from scenefw.core.types import GridSpec

EVEN = 32
"""Pixels: sides of images are multiples, so that all maps of a network have whole cells."""


class SetView(NamedTuple):
    """What is shown of B views, and the frame in which a network sees it.

    Args:
        condition: what its encoder sees: (B, 2, X, Y, Z) volumes, or (B, 10, H, W) images.
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
        ValueError: partial TSDFs without images.
    """
    depth, cameras = _images(partial)
    points, seen = seen_points(depth, cameras, grid, chances.to(depth.device))
    turn = torch.eye(3, device=points.device).expand(len(points), 3, 3)
    origin = points.new_zeros(len(points), 3)
    return SetView(condition(partial, grid), points, seen, turn, origin)


def image_view(partial: PartialTSDF, grid: GridSpec, width: int) -> SetView:
    """An image of places `width` pixels wide, as the camera looks along x.

    Args:
        partial: with its images.
        grid: outside which nothing counts.
        width: pixels; the height follows from the shape of the image.

    Raises:
        ValueError: partial TSDFs without images.
    """
    depth, cameras = _images(partial)
    width = max(round(width / EVEN), 1) * EVEN
    height = max(round(width * depth.shape[1] / depth.shape[2] / EVEN), 1) * EVEN
    rows, columns = (
        ((torch.arange(few, device=depth.device) + 0.5) * (many / few)).long()
        for few, many in ((height, depth.shape[1]), (width, depth.shape[2]))
    )
    pixels = (rows[:, None] * depth.shape[2] + columns).flatten().expand(len(depth), -1)
    read = depth.flatten(1).gather(1, pixels)
    places = places_of(read.nan_to_num(0.0), pixels, cameras)
    places = torch.where((read > 0)[..., None], places, torch.nan)
    return view_of_places(places.view(-1, height, width, 3), grid, cameras.T_world_camera[:, :3, 3])


def view_of_places(places: Tensor, grid: GridSpec, eye: Tensor) -> SetView:
    """A view from an image of places.

    Args:
        places: (B, H, W, 3) m, world, NaN where nothing is measured.
        grid: outside which nothing counts.
        eye: (B, 3) m, where cameras are.
    """
    lower = places.new_tensor(grid.lower)
    inside = ((places > lower) & (places < lower + grid.extent)).all(dim=-1)
    above = inside & (places[..., 2] > LOWEST)
    spots = torch.where(above[..., None], places, 0.0).flatten(1, 2)
    turn, origin = view_frame(spots[:, :, None], above.flatten(1), eye)
    local = torch.einsum("bij,bhwj->bhwi", turn, places - origin[:, None, None])
    points, seen = cell_points(local, above)
    return SetView(place_image(local, above), points, seen, turn, origin)


def _images(partial: PartialTSDF) -> tuple[Tensor, CameraBatch]:
    if partial.depth is None or partial.cameras is None:
        raise ValueError("queries need the depth images of partial TSDFs")
    return partial.depth, partial.cameras
