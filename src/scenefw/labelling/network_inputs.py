"""What labelling networks see: colours, and depth or one of two heights above the table."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.batches import CameraBatch
from scenefw.core.errors import ConfigError
from scenefw.core.types import Frame
from scenefw.kernels.cameras import stack_cameras
from scenefw.labelling.table_planes import heights_above_planes

DEPTH, HEIGHT, PLANE = "depth", "height", "plane_height"


def distance_images(depth: Tensor, cameras: CameraBatch, geometry: str = DEPTH) -> Tensor:
    """(B, H, W) float32 metres, NaN where nothing was measured.

    Args:
        depth: (B, H, W) z-depth, 0 or NaN = nothing.
        cameras: of the images; heights need their poses in the table's frame.
        geometry: `depth` along the optical axis (as in the thesis); `height` above the table by
            the pose (one of the channels of HHA, Gupta et al. 2014), as wrong as that; or
            `plane_height` above the plane found in the image, whatever the pose.

    Raises:
        ConfigError: another geometry.
    """
    if geometry == DEPTH:
        distances = depth
    elif geometry == HEIGHT:
        distances = _heights(depth, cameras)
    elif geometry == PLANE:
        distances = heights_above_planes(depth, cameras)
    else:
        raise ConfigError(f"geometry = {geometry!r}; expected {DEPTH}, {HEIGHT} or {PLANE}")
    return torch.where(depth > 0, distances, torch.nan)


def distance_image(frame: Frame, geometry: str = DEPTH) -> NDArray[np.float32]:
    """(H, W) float32 metres of one view, as `distance_images`."""
    depth = torch.from_numpy(frame.depth.copy())[None].float()
    distances: NDArray[np.float32] = distance_images(
        depth, stack_cameras([frame.camera]), geometry
    )[0].numpy()
    return distances


def image_tensor(colour: NDArray[np.uint8]) -> Tensor:
    """An image (H, W, 3) uint8 as (3, H, W) float32 in [0, 1], as networks take it."""
    return image_tensors(torch.from_numpy(np.ascontiguousarray(colour))[None])[0]


def image_tensors(colour: Tensor) -> Tensor:
    """Images (B, H, W, 3) uint8 as (B, 3, H, W) float32 in [0, 1]."""
    return colour.permute(0, 3, 1, 2).float() / 255


def _heights(depth: Tensor, cameras: CameraBatch) -> Tensor:
    fx, fy, cx, cy = cameras.intrinsics[:, :, None].unbind(1)
    x = (torch.arange(cameras.width, device=depth.device) - cx) / fx
    y = (torch.arange(cameras.height, device=depth.device) - cy) / fy
    right, down, ahead, above = cameras.T_world_camera[:, 2, :, None, None].unbind(1)
    return depth * (right * x[:, None] + down * y[:, :, None] + ahead) + above
