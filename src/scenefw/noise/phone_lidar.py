"""Noise of a phone's depth: few laser dots, spread smoothly over the image."""

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
from scenefw.noise.time_of_flight import patch_nodes, patches

if TYPE_CHECKING:
    from scenefw.core.batches import CameraBatch

_DRAWS = 4  # numbers that decide how much of each error an image has


@dataclass(eq=False)
class PhoneLidar:
    """Disturbs depth like the depth maps of phones, which are smooth where the scene isn't.

    Depth is read at a grid of dots, and a network of the phone spreads it over the image: edges
    become slopes as wide as the dots are apart, small things shrink, and what is left of the error
    varies slowly over the image. Pixels out of the laser's reach have no depth.

    Args:
        spacing: between dots (pixels), at most; each image has its own, from 2 on.
        wave: size of the patches over which the error varies (pixels).
        deviation: standard deviation of the error at 1 m (m), at most; it grows with the depth.
        farthest: no measurement beyond this depth (m).
        share: share of the images that are disturbed.

    Raises:
        ConfigError: an amount out of range, or a share that is none.
    """

    spacing: int = 8
    wave: float = 30.0
    deviation: float = 0.006
    farthest: float = 5.0
    share: float = 1.0

    def __post_init__(self) -> None:
        POSITIVE.require(wave=self.wave, spacing=self.spacing, farthest=self.farthest)
        NOT_NEGATIVE.require(deviation=self.deviation)
        SHARE.require(share=self.share)

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """Smooth copy of z-depth (B, H, W) in metres; 0 stays 0, the rest is positive or lost."""
        del cameras
        depth = finite(depth.float(), 0.0).clamp_min(0.0).contiguous()
        depth_in_reach = torch.where(depth <= self.farthest, depth, 0.0)
        streams = Streams.of(0, indices=seeds.cpu().numpy())
        amounts = streams.uniform(_DRAWS)
        height, width = depth.shape[1:]
        nodes = patch_nodes(streams, _DRAWS, height, width, self.wave)
        error = (patches(nodes, height, width, self.wave) - 0.5) * np.sqrt(12).astype(np.float32)
        scale = torch.from_numpy((self.deviation * amounts[:, 1]).astype(np.float32))
        smooth = torch.stack(
            [_spread(image, 2 + int(draw * max(self.spacing - 1, 0)))
             for image, draw in zip(depth_in_reach, amounts[:, 2], strict=True)]
        )  # fmt: skip
        noisy = smooth * (1 + (scale[:, None, None] * error).to(depth.device))
        disturbed = torch.from_numpy(amounts[:, 0] < self.share).to(depth.device)
        noisy = torch.where(depth_in_reach > 0, noisy.clamp_min(1e-3), 0.0)
        return torch.where(disturbed[:, None, None], noisy, depth)


def _spread(depth: Tensor, spacing: int) -> Tensor:
    """Depth (H, W) read at every so-manyth pixel, or as the mean nearby, and spread bilinearly."""
    image, weight = depth[None, None], (depth > 0).float()[None, None]
    size = (max(1, depth.shape[0] // spacing), max(1, depth.shape[1] // spacing))
    sums = functional.adaptive_avg_pool2d(image * weight, size)
    counts = functional.adaptive_avg_pool2d(weight, size)
    shape = depth.shape
    sums, counts = (functional.interpolate(values, shape, mode="bilinear", align_corners=False)
                    for values in (sums, counts))  # fmt: skip
    return (sums / counts.clamp_min(1e-6))[0, 0]
