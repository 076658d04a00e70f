"""Stored images as a camera elsewhere, in another light and with a sensor's noise, takes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.batches import CameraBatch
from scenefw.core.part_views import PartViewBatch
from scenefw.core.rng import Streams
from scenefw.core.settings import NOT_NEGATIVE, SHARE
from scenefw.data.batches.floor_motions import floor_motions
from scenefw.kernels.transfer import to_device
from scenefw_things.images.stored_images import DEPTH_UNIT, OBSTACLE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from scenefw.core.protocols import Noise
    from scenefw.core.types import Float64
    from scenefw_things.images.stored_images import StoredImages


@dataclass(frozen=True)
class ImageChanges:
    """Random changes of images, which follow from the images' random streams alone.

    Args:
        noise: disturbs depth, applied in the order of the names.
        colourless: chance that an image has no colours.
        brightness: most by which exposure changes, as a power of two; gamma and the light's colour
            change by half of it.
        scale: most by which scenes become larger or smaller, as a power of two.
        tilt: standard deviation of the found floor's slope (degrees), along x and y each.
        lift: the same of its height (m).

    Raises:
        ConfigError: a chance outside 0..1, or a negative deviation.
    """

    noise: Mapping[str, Noise]
    colourless: float
    brightness: float
    scale: float
    tilt: float
    lift: float

    def __post_init__(self) -> None:
        SHARE.require(colourless=self.colourless)
        NOT_NEGATIVE.require(tilt=self.tilt, lift=self.lift)

    def scales(self, streams: Streams) -> Float64:
        """Factors (B,) by which the scenes become larger."""
        return 2 ** (self.scale * (2 * self._chances(streams)[:, 0] - 1))

    def mirrored(self, streams: Streams) -> NDArray[np.bool_]:
        """Which images (B,) are seen in a mirror: columns turn round, x becomes -x."""
        return np.asarray(self._chances(streams)[:, 1] < 0.5)

    def _chances(self, streams: Streams) -> Float64:
        return streams.split(4)[3].uniform(3)

    @torch.no_grad()
    def apply(
        self, images: StoredImages, rows: NDArray[np.int64], streams: Streams, device: torch.device
    ) -> PartViewBatch:
        """Some of the images, changed as their streams say."""
        to_noise, to_floor, to_light, _ = streams.split(4)
        chances, light, scales = self._chances(streams), to_light.uniform(5), self.scales(streams)
        poses = images.poses[rows].astype(np.float64)
        poses[:, :3, 3] *= scales[:, None]
        seeds = np.ascontiguousarray(to_noise.seeds(len(self.noise)).T)
        width, height = images.size
        depth, owners, colour, intrinsics, poses, floors, seeds, light, scales = to_device(
            [
                images.depth[rows].astype(np.float32) * DEPTH_UNIT,
                images.owners[rows].astype(np.int32),
                images.colour[rows].astype(np.float32) / 255,
                images.intrinsics[rows].astype(np.float32),
                poses.astype(np.float32),
                floor_motions(to_floor, self.tilt, self.lift),
                seeds,
                light.astype(np.float32),
                scales.astype(np.float32),
            ],
            device,
        )
        depth = depth * scales[:, None, None]
        cameras = CameraBatch(width, height, intrinsics, poses)
        for noise, row in zip(self.noise.values(), seeds, strict=True):
            depth = noise.apply(depth, cameras, row)
        cameras = CameraBatch(width, height, intrinsics, floors @ poses)
        colour = _in_light(colour.permute(0, 3, 1, 2), self.brightness * (2 * light - 1))
        is_mirrored = torch.from_numpy(self.mirrored(streams)).to(device)
        colourless = torch.from_numpy(chances[:, 2] < self.colourless).to(device)
        colour = torch.where(colourless[:, None, None, None], torch.nan, colour)
        changed = PartViewBatch(depth, owners, cameras, owners >= OBSTACLE, colour)
        return _mirrored(changed, is_mirrored)


def _in_light(colour: torch.Tensor, changes: torch.Tensor) -> torch.Tensor:
    """Colours (B, 3, H, W) with another gamma, exposure and colour of the light (B, 5)."""
    changes = changes[:, :, None, None]
    gamma, exposure, tint = changes[:, :1] / 2, changes[:, 1:2], changes[:, 2:] / 2
    return (colour ** (2**gamma) * 2 ** (exposure + tint)).clamp(0, 1)


def _mirrored(batch: PartViewBatch, mask: torch.Tensor) -> PartViewBatch:
    """The images that `mask` (B,) names, in a mirror: columns turn round, x becomes -x."""

    def turned(values: torch.Tensor) -> torch.Tensor:
        return torch.where(mask.view(-1, *[1] * (values.dim() - 1)), values.flip(-1), values)

    cameras = batch.cameras
    flip = torch.ones(4, device=mask.device)
    flip[0] = -1
    intrinsics = cameras.intrinsics.clone()
    intrinsics[:, 2] = torch.where(mask, cameras.width - 1 - intrinsics[:, 2], intrinsics[:, 2])
    poses = cameras.T_world_camera
    poses = torch.where(mask[:, None, None], poses * flip[:, None] * flip, poses)
    assert batch.obstacles is not None
    assert batch.colour is not None
    return PartViewBatch(
        turned(batch.depth),
        turned(batch.owners),
        CameraBatch(cameras.width, cameras.height, intrinsics, poses),
        turned(batch.obstacles),
        turned(batch.colour),
    )
