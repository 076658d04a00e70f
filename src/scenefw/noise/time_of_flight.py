"""Noise of a time-of-flight camera: flying pixels, patches of little light, a smooth bias."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from scenefw.core.rng import Streams
from scenefw.core.settings import NOT_NEGATIVE, POSITIVE, SHARE
from scenefw.kernels.cameras import finite

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.batches import CameraBatch

_DRAWS = 6  # numbers that decide how much of each error an image has


@dataclass(eq=False)
class TimeOfFlight:
    """Disturbs depth like a camera that times its own light.

    A pixel at the edge of a surface gets light of both sides and measures a depth between: it
    flies. Deviations grow with the square of the depth, as less light comes back. In smooth
    patches, which stand for dark and shiny surfaces, they are larger; what comes back there has
    come by way of others (multipath) and seems farther, and the darkest of it is lost. How much of
    all this an image has is drawn for each.

    Args:
        deviation: standard deviation at 1 m (m), at most.
        flying: share of the pixels at edges that measure a depth between, at most.
        jump: difference of depth from which neighbours lie on two surfaces (m).
        patch: size of patches (pixels).
        dark: how many times larger the deviation is in the darkest patch.
        multipath: by how much the darkest patch seems farther (m), at most.
        lost: share of an image that is lost as too dark, at most.
        farthest: no measurement beyond this depth (m).
        share: share of the images that are disturbed.

    Raises:
        ConfigError: an amount that is negative, or a share that is none.
    """

    deviation: float = 0.003
    flying: float = 0.8
    jump: float = 0.02
    patch: float = 40.0
    dark: float = 4.0
    multipath: float = 0.008
    lost: float = 0.03
    farthest: float = 5.5
    share: float = 1.0

    def __post_init__(self) -> None:
        POSITIVE.require(jump=self.jump, patch=self.patch, dark=self.dark, farthest=self.farthest)
        NOT_NEGATIVE.require(deviation=self.deviation, multipath=self.multipath)
        SHARE.require(flying=self.flying, lost=self.lost, share=self.share)

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 stays 0, the rest is positive or lost."""
        del cameras
        depth = finite(depth.float(), 0.0).clamp_min(0.0).contiguous()
        depth_in_reach = torch.where(depth <= self.farthest, depth, 0.0)
        streams = Streams.of(0, indices=seeds.cpu().numpy())
        amounts = streams.uniform(_DRAWS)
        height, width = depth.shape[1:]
        nodes = patch_nodes(streams, _DRAWS, height, width, self.patch)
        pixels = streams.uniform(3 * height * width, _DRAWS + nodes.shape[1] * nodes.shape[2])
        lots = torch.from_numpy(pixels.astype(np.float32)).view(-1, 3, height, width)
        lots = lots.to(depth.device)
        scales = torch.from_numpy(amounts.astype(np.float32)).to(depth.device)[..., None, None]
        darkness = patches(nodes, height, width, self.patch).to(depth.device)
        mixed = self._flown(depth_in_reach, lots[:, 0], lots[:, 1], self.flying * scales[:, 1])
        white = torch.special.ndtri(lots[:, 2].clamp(1e-6, 1 - 1e-6))
        deviation = self.deviation * scales[:, 2] * (1 + (self.dark - 1) * darkness**2)
        noisy = mixed + deviation * mixed.square() * white
        noisy = noisy + self.multipath * scales[:, 3] * darkness**2
        lost = darkness > torch.quantile(
            darkness.flatten(1), 1 - self.lost, dim=1
        )[:, None, None] + scales[:, 4] * 0.1  # fmt: skip
        measured = (depth_in_reach > 0) & ~lost
        noisy = torch.where(measured, noisy.clamp_min(1e-3), 0.0)
        return torch.where(scales[:, 0] < self.share, noisy, depth)

    def _flown(self, depth: Tensor, luck: Tensor, way: Tensor, chance: Tensor) -> Tensor:
        """Depth where pixels at edges may lie between the nearest and the farthest neighbour."""
        images = depth[:, None]
        missing = images <= 0
        far = functional.max_pool2d(images, 3, 1, 1)[:, 0]
        near = -functional.max_pool2d(torch.where(missing, -torch.inf, -images), 3, 1, 1)[:, 0]
        flies = (far - near > self.jump) & (depth > 0) & (luck < chance)
        return torch.where(flies, near + way * (far - near), depth)


def patch_nodes(
    streams: Streams, start: int, height: int, width: int, size: float
) -> NDArray[np.float64]:
    """Numbers from 0 to 1 (B, rows, columns) at the nodes of smooth patches of a size (pixels)."""
    rows, columns = (int(np.ceil(side / size)) + 3 for side in (height, width))
    return streams.uniform(rows * columns, start).reshape(-1, rows, columns)


def patches(nodes: NDArray[np.float64], height: int, width: int, size: float) -> Tensor:
    """A smooth field (B, H, W) from 0 to 1 through numbers at nodes."""
    rows, columns = nodes.shape[1:]
    grid = torch.from_numpy(nodes.astype(np.float32))[:, None]
    shape = (round(rows * size), round(columns * size))
    field = functional.interpolate(grid, shape, mode="bicubic", align_corners=False)
    at = round(size)  # half a node off the edge, where the interpolation repeats the last one
    return field[:, 0, at : at + height, at : at + width].clamp(0, 1)
