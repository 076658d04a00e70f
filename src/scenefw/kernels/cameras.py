"""Cameras of a batch as tensors that kernels read."""

from collections.abc import Sequence

import numpy as np
import torch

from scenefw.core.batches import CameraBatch
from scenefw.core.errors import InputError
from scenefw.core.types import Camera


def stack_cameras(
    cameras: Sequence[Camera], device: torch.device | str | None = None
) -> CameraBatch:
    """Stacks B cameras of one image size into a batch on `device` (default: the CPU).

    Raises:
        InputError: no camera, several image sizes, or intrinsics or a pose that no camera has.
    """
    sizes = {(camera.width, camera.height) for camera in cameras}
    if len(sizes) != 1:
        raise InputError(
            f"a batch of cameras needs one image size, got {sorted(sizes) or 'no camera'}; "
            "resize the images or batch them by size"
        )
    for camera in cameras:
        _require_usable(camera)
    width, height = sizes.pop()
    intrinsics = np.array([[c.fx, c.fy, c.cx, c.cy] for c in cameras], dtype=np.float32)
    poses = np.stack([c.T_world_camera for c in cameras]).astype(np.float32)
    return CameraBatch(
        width, height, torch.from_numpy(intrinsics).to(device), torch.from_numpy(poses).to(device)
    )


def camera_of(cameras: CameraBatch, index: int) -> Camera:
    """One camera of a batch."""
    fx, fy, cx, cy = cameras.intrinsics[index].tolist()
    pose = cameras.T_world_camera[index].double().cpu().numpy()
    return Camera(cameras.width, cameras.height, fx, fy, cx, cy, pose)


def floor_depths(cameras: CameraBatch, level: float = 0.02) -> torch.Tensor:
    """z-depth (B, H, W) at which the rays of pixels meet the floor z = 0 (m).

    Args:
        cameras: above the floor.
        level: rays go down by this much per metre of z-depth at least, so that all of them meet it.
    """
    device = cameras.intrinsics.device
    fx, fy, cx, cy = cameras.intrinsics[:, :, None, None].unbind(1)
    rows = torch.arange(cameras.height, device=device)[:, None]
    columns = torch.arange(cameras.width, device=device)
    right, below, ahead = cameras.T_world_camera[:, 2, :3, None, None].unbind(1)
    up = right * (columns - cx) / fx + below * (rows - cy) / fy + ahead
    return cameras.T_world_camera[:, 2, 3, None, None] / (-up).clamp_min(level)


def pixel_places(depth: torch.Tensor, cameras: CameraBatch) -> torch.Tensor:
    """World coordinates (B, H, W, 3) of all pixels (m).

    Args:
        depth: (B, H, W) z-depth in metres.
        cameras: one per image.
    """
    depth = require_depth(depth, cameras)
    pixels = torch.arange(depth[0].numel(), device=depth.device).expand(len(depth), -1)
    return places_of(depth.flatten(1), pixels, cameras).view(*depth.shape, 3)


def places_of(depth: torch.Tensor, pixels: torch.Tensor, cameras: CameraBatch) -> torch.Tensor:
    """World coordinates (B, P, 3) of some pixels (m).

    Args:
        depth: (B, P) z-depth of them in metres.
        pixels: (B, P) their numbers, row by row.
        cameras: one per image.
    """
    fx, fy, cx, cy = cameras.intrinsics[:, :, None].unbind(1)
    x = (pixels % cameras.width - cx) / fx * depth
    y = (pixels // cameras.width - cy) / fy * depth
    pose = cameras.T_world_camera
    local = torch.stack([x, y, depth], dim=-1)
    return local @ pose[:, :3, :3].transpose(-1, -2) + pose[:, None, :3, 3]


def require_depth(depth: torch.Tensor, cameras: CameraBatch) -> torch.Tensor:
    """Returns depth (B, H, W) as contiguous float32 with 0 where not finite.

    Raises:
        InputError: its shape is not that of the cameras, or it lies on another device.
    """
    expected = (len(cameras.intrinsics), cameras.height, cameras.width)
    if tuple(depth.shape) != expected:
        raise InputError(
            f"depth has shape {tuple(depth.shape)}, but its cameras make {expected}; "
            "give one camera per image, with the intrinsics of this image size"
        )
    if depth.device != cameras.intrinsics.device:
        raise InputError(
            f"depth is on {depth.device}, its cameras on {cameras.intrinsics.device}; "
            "move them to one device"
        )
    return finite(depth, 0.0)


def finite(values: torch.Tensor, otherwise: float) -> torch.Tensor:
    """Returns contiguous float32 values with NaN and infinities replaced."""
    values = values.detach().float().contiguous()
    if values.device.type == "cpu" and bool(values.sum().isfinite()):  # cheaper than a copy
        return values
    return torch.nan_to_num(values, nan=otherwise, posinf=otherwise, neginf=otherwise)


def _require_usable(camera: Camera) -> None:
    pose = np.asarray(camera.T_world_camera)
    rotation = pose[:3, :3]
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise InputError(f"camera pose {pose.tolist()} is no finite 4x4 matrix; check its source")
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4):
        raise InputError(
            f"camera pose has no rotation in its upper left 3x3 {rotation.tolist()}; "
            "orthonormalise it (and leave scale out of it)"
        )
    focal = (camera.fx, camera.fy)
    if not np.isfinite([*focal, camera.cx, camera.cy]).all() or min(focal) <= 0:
        raise InputError(
            f"camera intrinsics fx, fy = {focal}, cx, cy = {(camera.cx, camera.cy)} are unusable; "
            "expected finite values with positive focal lengths, in pixels"
        )
