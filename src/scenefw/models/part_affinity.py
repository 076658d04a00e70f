"""Which neighbouring pixels of a depth image show the same object."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn
from torch.nn import functional

from scenefw.core.errors import ConfigError
from scenefw.kernels.cameras import pixel_places
from scenefw.kernels.precision import full_precision
from scenefw.models.conv_level import ConvLevel
from scenefw.models.recipes import recipe_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.batches import CameraBatch

_STEPS, _NORMAL_STEPS = (1, 2, 4), (1, 3)  # pixels to neighbours that a pixel is compared with
_FAR = 4.0  # m: the images that it learns from show nothing beyond; 1 km would drown all else
_RISE, _BEND, _HEIGHT = 0.005, 0.002, 0.01  # m: logarithmic above, linear below
CHANNELS = 6 * len(_STEPS) + 3 * len(_NORMAL_STEPS) + 3
"""Of `pixel_features`."""
_MIN_CONTRAST = 1 / 255  # a step of 8 bits: an image of one colour has no edges


class PartAffinity(nn.Module):
    """A U-Net on local geometry (Ronneberger et al. 2015) that gives affinities of pixels.

    It sees how depth changes to neighbours some pixels away, surface normals in the world frame,
    and the height above the floor: absolute coordinates would drown what tells two touching
    objects apart. From a pixel to its right and lower neighbour, it says how likely both show the
    same object, or both the floor. With `shown` it also says how likely a pixel shows an object: a
    floor that a camera measures badly has waves as high as flat things. With `obstacles` it says
    how likely a pixel shows what stands there and is no object: a wall, a robot. With `colour` it
    sees colours as well, where an image has them, relative to those of the whole image.

    Args:
        widths: channels of the levels; each has half the size of the one before it.
        shown: whether it says which pixels show objects.
        obstacles: whether it says which pixels show obstacles.
        colour: whether it sees colours.
        focal: focal length (pixels) of the images that it learns from; others are thinned to it.

    Raises:
        ConfigError: fewer than two levels, a number that isn't positive, or obstacles without
            objects.
    """

    training_only: Sequence[str] = ()

    def __init__(
        self,
        widths: Sequence[int],
        focal: float = 289.7,
        *,
        shown: bool,
        obstacles: bool = False,
        colour: bool = False,
    ) -> None:
        super().__init__()
        if len(widths) < 2 or min(widths) < 1 or not focal > 0:
            raise ConfigError(
                f"part_affinity has widths {list(widths)} and focal {focal}; expected two levels "
                "or more of at least 1 channel, and pixels"
            )
        if obstacles and not shown:
            raise ConfigError("part_affinity has obstacles without objects; give model.shown=true")
        self.recipe = recipe_of(self, locals())
        self.focal, self.stride = focal, 2 ** (len(widths) - 1)
        self.down = nn.ModuleList(
            ConvLevel(a, b) for a, b in zip([CHANNELS, *widths], widths, strict=False)
        )
        pairs = list(pairwise(widths))[::-1]
        self.up = nn.ModuleList(ConvLevel(fine + coarse, fine) for fine, coarse in pairs)
        self.head = nn.Conv2d(widths[0], 2, 1)
        self.shown = nn.Conv2d(widths[0], 1, 1) if shown else None
        self.obstacles = nn.Conv2d(widths[0], 1, 1) if obstacles else None
        self.colour = _colour_branch(widths[0]) if colour else None

    def forward(self, depth: Tensor, cameras: CameraBatch, colour: Tensor | None = None) -> Tensor:
        """Logits that the right and the lower neighbour show the same object, (B, 2, H, W).

        With `shown` a third: that the pixel shows an object; with `obstacles` a fourth.

        Args:
            depth: (B, H, W) z-depth in metres, 0 = no measurement.
            cameras: one per image, the floor at z = 0.
            colour: (B, 3, H, W) from 0 to 1, NaN in images without; None: no image has any.
        """
        height, width = depth.shape[1:]
        padding = (0, -width % self.stride, 0, -height % self.stride)
        features = functional.pad(pixel_features(depth, cameras), padding)
        features, skips = features.contiguous(memory_format=torch.channels_last), []
        for number, level in enumerate(self.down):
            features = level(functional.max_pool2d(features, 2) if number else features)
            if not number and self.colour is not None and colour is not None:
                colours = functional.pad(colour_features(colour), padding)
                is_coloured = colour.isfinite().all(dim=(1, 2, 3))[:, None, None, None]
                features = features + torch.where(is_coloured, self.colour(colours), 0.0)
            skips.append(features)
        for level, fine in zip(self.up, skips[-2::-1], strict=True):
            features = level(
                torch.cat([functional.interpolate(features, scale_factor=2.0), fine], dim=1)
            )
        heads = (self.head, self.shown, self.obstacles)
        logits = torch.cat([head(features) for head in heads if head is not None], dim=1)
        return logits[..., :height, :width].float()


def _colour_branch(width: int) -> nn.Sequential:
    """Features of colours, which at first add nothing: so weights without colour go on."""
    last = nn.Conv2d(width, width, 1)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return nn.Sequential(ConvLevel(3, width), last)


@torch.no_grad()
@full_precision()
def colour_features(colour: Tensor) -> Tensor:
    """Colours (B, 3, H, W) against mean and spread of their image; 0 in images without.

    So neither exposure nor the colour of the light counts.

    Args:
        colour: (B, 3, H, W) from 0 to 1, NaN in images without.
    """
    values = torch.nan_to_num(colour)
    values = values - values.mean(dim=(2, 3), keepdim=True)
    return values / values.std(dim=(1, 2, 3), keepdim=True).clamp_min(_MIN_CONTRAST)


@torch.no_grad()
@full_precision()
def pixel_features(depth: Tensor, cameras: CameraBatch) -> Tensor:
    """Local geometry (B, `CHANNELS`, H, W) of depth images, 0 where it is not known.

    Args:
        depth: (B, H, W) z-depth in metres, 0 = no measurement; nor is what is beyond 4 m, as the
            floor of a traced image just below its horizon.
        cameras: one per image, the floor at z = 0.
    """
    depth = torch.where(depth <= _FAR, depth, 0.0)
    valid, points = depth > 0, pixel_places(depth, cameras).permute(0, 3, 1, 2)
    channels: list[Tensor] = []
    for step in _STEPS:
        for axis in (2, 1):
            before, after = (_rise(depth, valid, way, axis) for way in (step, -step))
            channels += [_log(before, _RISE), _log(after, _RISE), _log(before + after, _BEND)]
    for step in _NORMAL_STEPS:
        across, down = (points.roll(-step, k) - points.roll(step, k) for k in (3, 2))
        normals = functional.normalize(torch.linalg.cross(across, down, dim=1), dim=1)
        channels += list(normals.unbind(dim=1))
    channels += [_log(points[:, 2], _HEIGHT), depth - 1, valid.float()]
    return torch.where(valid[:, None], torch.stack(channels, dim=1), 0.0)


def _rise(depth: Tensor, valid: Tensor, step: int, axis: int) -> Tensor:
    """How much further away (m) the pixel `step` before is; 0 where either has no depth."""
    valid_pairs = valid & valid.roll(step, axis)
    return torch.where(valid_pairs, depth.roll(step, axis) - depth, 0.0)


def _log(length: Tensor, unit: float) -> Tensor:
    return torch.asinh(length / unit) / 3
