"""Depth images of superquadrics by rays, disturbed as a camera does, without a volume."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from scenefw.kernels.cameras import floor_depths
from scenefw.kernels.superquadric_rays import first_hits

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor

    from scenefw.core.batches import CameraBatch, SceneParameters
    from scenefw.core.protocols import Noise

_SAME = 0.02  # m: what reads a depth further off shows something else


def ray_images(
    scenes: SceneParameters, cameras: CameraBatch, noise: Mapping[str, Noise], seeds: Tensor
) -> tuple[Tensor, Tensor]:
    """Depth (B, H, W) with the floor, NaN = unknown, and whose each pixel is: 0 = nobody's.

    A pixel that reads the depth of something else, as at edges, is nobody's.

    Args:
        scenes: what is seen.
        cameras: of the images.
        noise: by name, applied in this order.
        seeds: (noises, B) of each noise.
    """
    depth, owners = first_hits(scenes, cameras)
    depth = torch.where(owners > 0, depth, floor_depths(cameras))
    if not noise:
        return depth, owners
    noisy = depth
    for noise_model, row in zip(noise.values(), seeds, strict=True):
        noisy = noise_model.apply(noisy, cameras, row)
    same_surface = (noisy > 0) & ((noisy - depth).abs() < _SAME)
    return torch.where(noisy > 0, noisy, torch.nan), torch.where(same_surface, owners, 0)
