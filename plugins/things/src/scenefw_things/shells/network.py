"""From a crop about an object to its shell: where each ray enters and leaves it."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn
from torch.nn import functional

from scenefw.core.errors import ConfigError
from scenefw.core.settings import COUNT, NOT_NEGATIVE, SHARE
from scenefw.kernels.cameras import floor_depths, pixel_places
from scenefw.kernels.precision import full_precision
from scenefw.models.conv_level import ConvLevel
from scenefw.models.part_affinity import colour_features
from scenefw_things.shells.batches import ShellPrediction
from scenefw_things.shells.crops import references

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw_things.shells.batches import ObjectCrops

_REACH = 2.0  # widths of a crop: depths farther off than this are all alike
_HEIGHT = 0.05  # m: heights above the floor are logarithmic from here on
_WIDTH = 0.15  # m: of a usual crop
_OUTPUTS = 6  # amodal, hollow, entry, thickness, two shares of it
CHANNELS = 14
"""Of `crop_features`."""


class ObjectShells(nn.Module):
    """A U-Net on crops (Ronneberger et al. 2015) that gives object shells.

    A shell (Chavan-Dafle et al. 2020) is the entry and the exit depth of each ray through an
    object, hidden parts too; here also the gap between both, where a ray passes a hollow. Depths
    count from the object's visible median, in widths of the crop. The visible entry is the measured
    depth, corrected. What a view leaves open follows a code: 0 gives one best guess, codes drawn
    from N(0, I) give joint hypotheses of the whole object. Two by two pixels are one on the way in
    and out, which takes a quarter of the time; codes change all four alike, as each by itself would
    make combs of smooth surfaces.

    Args:
        widths: channels of the levels; each has half the size of the one before it.
        latent_size: length of the code.
        drawn: share of a training batch for which two codes are drawn.

    Raises:
        ConfigError: fewer than two levels, a number out of range, or no code to draw.
    """

    training_only: Sequence[str] = ()

    def __init__(self, widths: Sequence[int], latent_size: int = 16, drawn: float = 0.25) -> None:
        super().__init__()
        COUNT.require(widths=widths)
        NOT_NEGATIVE.require(latent_size=latent_size)
        SHARE.require(drawn=drawn)
        if len(widths) < 2:
            raise ConfigError(f"object_shells has widths {list(widths)}; expected two or more")
        if drawn and not latent_size:
            raise ConfigError("object_shells draws codes of no length; give model.latent_size")
        self.recipe = {"_target_": f"{__name__}.ObjectShells", "widths": list(widths),
                       "latent_size": latent_size, "drawn": drawn}  # fmt: skip
        self.latent_size, self.drawn, self.stride = latent_size, drawn, 2 ** len(widths)
        self.down = nn.ModuleList(
            ConvLevel(a, b) for a, b in zip([4 * CHANNELS, *widths], widths, strict=False)
        )
        pairs = list(pairwise(widths))[::-1]
        self.up = nn.ModuleList(ConvLevel(fine + coarse, fine) for fine, coarse in pairs)
        self.code = nn.ModuleList(_code_layer(latent_size, w) for w in reversed(widths))
        self.head = nn.Conv2d(widths[0], 4 * _OUTPUTS, 1)

    def draws(self, count: int) -> int:
        """Of how many of `count` crops a training pass draws codes."""
        return round(self.drawn * count)

    def forward(
        self, crops: ObjectCrops, generator: torch.Generator | None = None
    ) -> ShellPrediction:
        """Shells of the zero code; with a generator those of two random codes for some crops too.

        Args:
            crops: of N objects; a side has a multiple of `stride` pixels.
            generator: of codes, on the CPU; None: none is drawn.
        """
        count = len(crops.depth)
        drawn = 0 if generator is None else self.draws(count)
        codes = torch.randn(2 * drawn, self.latent_size, generator=generator).to(crops.depth.device)
        features = self._encoded(crops)
        rows = torch.arange(count, device=crops.depth.device)
        codes = torch.cat([codes.new_zeros(count, self.latent_size), codes])
        whole = self._decoded(features, crops, torch.cat([rows, rows[:drawn], rows[:drawn]]), codes)
        best, first, second = _split(whole, [count, drawn, drawn])
        if not drawn:
            return best
        return ShellPrediction(best.amodal, best.hollow, best.depths, (first, second))

    def sample(self, crops: ObjectCrops, codes: Tensor) -> ShellPrediction:
        """Shells of S N crops, code after code.

        Args:
            crops: of N objects.
            codes: (S, N, latent_size), drawn from N(0, I), but the first: 0, the best guess.
        """
        rows = torch.arange(len(crops.depth), device=codes.device).repeat(len(codes))
        return self._decoded(self._encoded(crops), crops, rows, codes.flatten(0, 1))

    def _encoded(self, crops: ObjectCrops) -> list[Tensor]:
        """Features of the levels, the finest first."""
        values = functional.pixel_unshuffle(crop_features(crops), 2)
        values, features = values.contiguous(memory_format=torch.channels_last), []
        for number, level in enumerate(self.down):
            values = level(functional.max_pool2d(values, 2) if number else values)
            features.append(values)
        return features

    def _decoded(
        self, features: list[Tensor], crops: ObjectCrops, rows: Tensor, codes: Tensor
    ) -> ShellPrediction:
        """Shells of some of the crops, each with a code (M, latent_size); 0 and all crops first."""
        layers = iter(self.code)
        values = _modulated(features[-1][rows], next(layers)(codes))
        for level, fine in zip(self.up, features[-2::-1], strict=True):
            larger = functional.interpolate(values, scale_factor=2.0)
            values = _modulated(level(torch.cat([larger, fine[rows]], 1)), next(layers)(codes))
        outputs = self.head(values).float()
        best = outputs[: len(crops.depth)][rows]
        changes = (outputs - best).unflatten(1, (_OUTPUTS, 4)).mean(dim=2, keepdim=True)
        outputs = best + changes.expand(-1, -1, 4, -1, -1).flatten(1, 2)
        return _shells(functional.pixel_shuffle(outputs, 2), crops, rows)


def _code_layer(latent_size: int, width: int) -> nn.Linear:
    """Factors and offsets of features that follow from a code; the zero code changes nothing."""
    return nn.Linear(latent_size, 2 * width, bias=False)


def _modulated(features: Tensor, changes: Tensor) -> Tensor:
    factors, offsets = changes[:, :, None, None].chunk(2, dim=1)
    return features * (1 + factors) + offsets


def _split(whole: ShellPrediction, counts: list[int]) -> list[ShellPrediction]:
    parts = (whole.amodal.split(counts), whole.hollow.split(counts), whole.depths.split(counts))
    return [ShellPrediction(*part) for part in zip(*parts, strict=True)]


@full_precision()
def _shells(outputs: Tensor, crops: ObjectCrops, rows: Tensor) -> ShellPrediction:
    """Depths in order along each ray, from outputs (M, 6, R, R)."""
    reference, width = (values[:, None, None] for values in references(crops))
    base = torch.where(crops.visible, crops.depth - reference, 0.0)[rows]
    reference, width = reference[rows], width[rows]
    amodal, hollow, entry, thickness, start, end = outputs.unbind(dim=1)
    thickness = functional.softplus(thickness - 1.5) * width
    entry = reference + base + entry * width
    start = torch.sigmoid(start) * thickness
    end = start + torch.sigmoid(end) * (thickness - start)
    depths = torch.stack([entry, entry + thickness, entry + start, entry + end], dim=1)
    return ShellPrediction(amodal, hollow, depths)


@torch.no_grad()
@full_precision()
def crop_features(crops: ObjectCrops) -> Tensor:
    """What the network sees (N, `CHANNELS`, R, R): masks, depth, height, floor, size, colour."""
    cameras, measured = crops.cameras, crops.depth > 0
    reference, width = (values[:, None, None] for values in references(crops))
    places = pixel_places(crops.depth, cameras)

    def relative(depth: Tensor) -> Tensor:
        return ((depth - reference) / width).clamp(-_REACH, _REACH)

    height = places[..., 2]
    up = cameras.T_world_camera[:, 2, :3, None, None].expand(-1, -1, *crops.depth.shape[1:])
    features = [
        measured.float(),
        crops.visible.float(),
        crops.others.float(),
        torch.where(measured, relative(crops.depth), 0.0),
        torch.where(crops.visible, relative(crops.depth), 0.0),
        torch.where(measured, torch.asinh(height / _HEIGHT), 0.0),
        relative(floor_depths(cameras)),
        torch.log(width / _WIDTH).expand_as(crops.depth),
    ]
    values = torch.cat([torch.stack(features, dim=1), up], dim=1)
    return torch.cat([values, _colours(crops)], dim=1)


def _colours(crops: ObjectCrops) -> Tensor:
    if crops.colour is None:
        count, *sides = crops.depth.shape
        return crops.depth.new_zeros(count, 3, *sides)
    is_coloured = crops.colour.isfinite().all(dim=(1, 2, 3))[:, None, None, None]
    return torch.where(is_coloured, colour_features(crops.colour), 0.0)
