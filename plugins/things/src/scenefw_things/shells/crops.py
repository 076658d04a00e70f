"""Square windows of depth images about single objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import torch

from scenefw.core.batches import CameraBatch
from scenefw.core.errors import ConfigError
from scenefw.core.settings import COUNT, POSITIVE, at_least
from scenefw_things.shells.batches import ObjectCrops

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor

    from scenefw.core.part_views import PartViewBatch


@dataclass(frozen=True)
class CropShape:
    """How large crops about objects are, as a network learnt from them.

    Args:
        resolution: pixels per side.
        margin: side by the longer side of what is visible of the object.
        min_width: across a crop at its object (m): a speck tells little of how large that is.
        min_pixels: measured pixels of an object in its crop; of less no shape follows.

    Raises:
        ConfigError: a number out of range.
    """

    resolution: int
    margin: float
    min_width: float
    min_pixels: int

    def __post_init__(self) -> None:
        COUNT.require(resolution=self.resolution, min_pixels=self.min_pixels)
        at_least(1).require(margin=self.margin)
        POSITIVE.require(min_width=self.min_width)

    @classmethod
    def of(cls, metadata: Mapping[str, Any]) -> CropShape:
        """That of the crops that weights learnt from, by their metadata.

        Raises:
            ConfigError: they don't say.
        """
        try:
            return cls(**metadata["crops"])
        except (KeyError, TypeError) as error:
            raise ConfigError(
                "weights of object_shells don't say which crops they learnt from; train them anew "
                "with experiment=object_shells"
            ) from error


def windows(visible: Tensor, margins: Tensor, shifts: Tensor, min_side: Tensor) -> Tensor:
    """Windows (N, 3) about masks: left and upper edge, and side, in pixels; 0 is an image's corner.

    Args:
        visible: (N, H, W) bool, pixels of the objects.
        margins: (N,) sides by the longer side of what is visible.
        shifts: (N, 2) of a window's middle to the right and down, by its side.
        min_side: (N,) pixels: a speck tells little of how large its object is.
    """
    left, right = _ends(visible.any(dim=1))
    top, bottom = _ends(visible.any(dim=2))
    longer = torch.maximum(right - left, bottom - top)
    side = torch.maximum(margins * longer, min_side)
    middle = torch.stack([left + right, top + bottom], dim=1) / 2 + shifts * side[:, None]
    return torch.cat([middle - side[:, None] / 2, side[:, None]], dim=1)


def _ends(occupied: Tensor) -> tuple[Tensor, Tensor]:
    """First and one after the last True of rows (N, K)."""
    values = occupied.int()
    first = values.argmax(dim=1)
    last = occupied.shape[1] - values.flip(1).argmax(dim=1)
    return first.float(), last.float()


def crop(
    views: PartViewBatch, rows: Tensor, owners: Tensor, squares: Tensor, resolution: int
) -> ObjectCrops:
    """What lies in windows of images, each pixel that of the image in which its middle falls.

    Args:
        views: B images.
        rows: (N,) int64, whose image each window is of.
        owners: (N,) int32 of the objects.
        squares: (N, 3) as of `windows`; what lies beside the image isn't measured.
        resolution: pixels per side of a crop.
    """
    height, width = views.depth.shape[1:]
    steps = (torch.arange(resolution, device=squares.device) + 0.5) / resolution
    columns = (squares[:, :1] + steps * squares[:, 2:]).floor().long()
    lines = (squares[:, 1:2] + steps * squares[:, 2:]).floor().long()
    in_columns, in_lines = (columns >= 0) & (columns < width), (lines >= 0) & (lines < height)
    within = in_lines[:, :, None] & in_columns[:, None]
    columns, lines = columns.clamp(0, width - 1), lines.clamp(0, height - 1)
    places = (rows[:, None, None], lines[:, :, None], columns[:, None])
    depth = torch.where(within, views.depth[places], 0.0)
    measured, ids = depth > 0, views.owners[places]
    is_object = ids == owners[:, None, None]
    colour = None
    if views.colour is not None:
        colour = views.colour.permute(0, 2, 3, 1)[places].permute(0, 3, 1, 2)
    return ObjectCrops(
        depth, measured & is_object, measured & ~is_object & (ids > 0),
        _cameras(views.cameras, rows, squares, resolution), colour,
    )  # fmt: skip


def _cameras(cameras: CameraBatch, rows: Tensor, squares: Tensor, resolution: int) -> CameraBatch:
    pixel = squares[:, 2:] / resolution
    focal, middle = cameras.intrinsics[rows].split(2, dim=1)
    lenses = torch.cat([focal / pixel, (middle + 0.5 - squares[:, :2]) / pixel - 0.5], dim=1)
    return CameraBatch(resolution, resolution, lenses, cameras.T_world_camera[rows])


def references(crops: ObjectCrops) -> tuple[Tensor, Tensor]:
    """Median depth of what is visible of objects, and the width of their crops there (m).

    Both are (N,); where nothing is visible the depth is 1 m.
    """
    depth = torch.where(crops.visible, crops.depth, torch.nan).flatten(1)
    reference = torch.nan_to_num(depth.nanmedian(dim=1).values, nan=1.0)
    return reference, reference * crops.cameras.width / crops.cameras.intrinsics[:, 0]
