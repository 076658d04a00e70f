"""Noise of a structured-light depth camera: shadows, holes, lateral and axial noise, steps."""

import math

import torch
from torch import Tensor

from scenefw.core.errors import ConfigError
from scenefw.core.types import CameraBatch


class Kinect:
    """Disturbs depth as a projector and a camera beside it do, in the order in which light does.

    1. Background that the projector can't light, as something nearer stands before it, is lost: a
       shadow on the left of objects for a projector on the right.
    2. Grazing surfaces are lost, with a probability growing from 0 to 1 between two angles. Angles
       come from the depth image, so depth edges count as grazing and fray.
    3. Every pixel reads the depth of a spot shifted by Gaussian noise (Handa et al. 2014).
    4. Gaussian axial noise with the standard deviation that Nguyen et al. (2012) measured,
       0.0012 + 0.0019 (z - 0.4)^2 metres.
    5. Disparity is rounded to steps, so depth steps grow with z^2.
    6. Single pixels and depths out of range are lost.

    Args:
        baseline: from the camera to the projector on its right (m); negative for one on its left.
        disparity_step: smallest step of disparity (pixels of the given image).
        lateral: standard deviation of the lateral shift (pixels).
        axial: factor on the axial standard deviation; 0 switches it off.
        grazing_from: angle between ray and normal from which pixels are lost (degrees).
        grazing_to: angle from which all are lost (degrees).
        dropout: share of pixels lost at random.
        nearest: no measurement below this depth (m).
        farthest: no measurement beyond this depth (m).
        share: share of the images that are disturbed; the others pass as they are.
    """

    def __init__(
        self,
        baseline: float = 0.075,
        disparity_step: float = 0.125,
        lateral: float = 0.7,
        axial: float = 1.0,
        grazing_from: float = 75.0,
        grazing_to: float = 87.0,
        dropout: float = 0.002,
        nearest: float = 0.4,
        farthest: float = 8.0,
        share: float = 1.0,
    ) -> None:
        _require(baseline != 0, "baseline", baseline, "a distance other than 0 in metres")
        _require(disparity_step > 0, "disparity_step", disparity_step, "pixels above 0")
        _require(lateral >= 0, "lateral", lateral, "pixels, 0 or more")
        _require(axial >= 0, "axial", axial, "a factor, 0 or more")
        _require(0 <= grazing_from < grazing_to, "grazing_from", grazing_from, "below grazing_to")
        _require(0 <= dropout <= 1, "dropout", dropout, "a share between 0 and 1")
        _require(0 <= nearest < farthest, "nearest", nearest, "metres below farthest")
        _require(0 <= share <= 1, "share", share, "a share between 0 and 1")
        self.baseline = baseline
        self.disparity_step = disparity_step
        self.lateral = lateral
        self.axial = axial
        self.grazing_from = math.radians(grazing_from)
        self.grazing_to = math.radians(grazing_to)
        self.dropout = dropout
        self.nearest = nearest
        self.farthest = farthest
        self.share = share

    def apply(self, depth: Tensor, cameras: CameraBatch, generator: torch.Generator) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 stays 0, as long as nothing shifts onto it.

        Args:
            depth: (B, H, W) metres, on the generator's device.
            cameras: one per image; focal length and baseline make the disparity.
            generator: its device is the depth's.
        """
        lit = torch.where(self._shadow(depth, cameras), 0.0, depth)
        lit = torch.where(self._grazing(depth, cameras, generator), 0.0, lit)
        shifted = self._shift(lit, generator)
        noisy = self._axial(shifted, generator)
        stepped = self._steps(noisy, cameras)
        keep = (stepped >= self.nearest) & (stepped <= self.farthest) & (shifted > 0)
        keep &= _uniform(depth, generator) >= self.dropout
        disturbed = _uniform(depth[:, :1, :1], generator) < self.share
        return torch.where(disturbed, torch.where(keep, stepped, 0.0), depth)

    def _disparity(self, depth: Tensor, cameras: CameraBatch) -> Tensor:
        focal = cameras.intrinsics[:, 0, None, None]
        return focal * abs(self.baseline) / depth.clamp(min=1e-6)

    def _shadow(self, depth: Tensor, cameras: CameraBatch) -> Tensor:
        """Where something that the projector sees in the same direction is nearer to the camera."""
        columns = torch.arange(depth.shape[2], device=depth.device, dtype=depth.dtype)
        disparity = self._disparity(depth, cameras)
        if self.baseline < 0:
            columns, disparity = columns.flip(0), disparity.flip(2)
            shadow = _hidden(columns.max() - columns - disparity, depth.flip(2))
            return shadow.flip(2)
        return _hidden(columns - disparity, depth)

    def _grazing(self, depth: Tensor, cameras: CameraBatch, generator: torch.Generator) -> Tensor:
        """Random pixels, more of them the more the ray grazes the surface."""
        angle = _incidence(depth, cameras)
        share = (angle - self.grazing_from) / (self.grazing_to - self.grazing_from)
        return _uniform(depth, generator) < share

    def _shift(self, depth: Tensor, generator: torch.Generator) -> Tensor:
        """Each pixel's depth replaced by that of a pixel nearby."""
        batch, height, width = depth.shape
        shape = (2, batch, height, width)
        noise = torch.randn(shape, generator=generator, device=depth.device)
        shift = (self.lateral * noise).round().to(torch.int64)
        rows = torch.arange(height, device=depth.device)[:, None] + shift[0]
        columns = torch.arange(width, device=depth.device) + shift[1]
        at = rows.clamp(0, height - 1) * width + columns.clamp(0, width - 1)
        return depth.flatten(1).gather(1, at.flatten(1)).view_as(depth)

    def _axial(self, depth: Tensor, generator: torch.Generator) -> Tensor:
        sigma = self.axial * (0.0012 + 0.0019 * (depth - 0.4) ** 2)
        noise = torch.randn(depth.shape, generator=generator, device=depth.device)
        return (depth + sigma * noise.to(depth.dtype)).clamp(min=1e-6)

    def _steps(self, depth: Tensor, cameras: CameraBatch) -> Tensor:
        """Depth whose disparity is a multiple of the step; 0 where that is no step at all."""
        count = (self._disparity(depth, cameras) / self.disparity_step).round()
        focal = cameras.intrinsics[:, 0, None, None]
        stepped = focal * abs(self.baseline) / (count.clamp(min=1) * self.disparity_step)
        return torch.where(count > 0, stepped, 0.0)


def _hidden(position: Tensor, depth: Tensor) -> Tensor:
    """Where a pixel farther right in the row lies farther left (by a pixel) for the projector."""
    blocking = torch.where(depth > 0, position, torch.inf)
    leftmost = blocking.flip(2).cummin(dim=2).values.flip(2)
    return position > leftmost + 1


def _incidence(depth: Tensor, cameras: CameraBatch) -> Tensor:
    """Angle (B, H, W) in radians between each ray and the normal of the depth image's surface.

    With z(u, v) the surface's normal is along (-fx z_u, -fy z_v, z + (u - cx) z_u + (v - cy) z_v).
    """
    fx, fy, cx, cy = cameras.intrinsics[:, :, None, None].unbind(1)
    u = torch.arange(depth.shape[2], device=depth.device) - cx
    v = torch.arange(depth.shape[1], device=depth.device)[:, None] - cy
    slope_u, slope_v = _slope(depth, 2), _slope(depth, 1)
    x, y = -fx * slope_u, -fy * slope_v
    z = depth + u * slope_u + v * slope_v
    # normal . (u / fx, v / fy, 1) is z-depth itself
    length = (x * x + y * y + z * z).sqrt() * ((u / fx) ** 2 + (v / fy) ** 2 + 1).sqrt()
    return torch.acos((depth / length.clamp(min=1e-12)).clamp(0, 1))


def _slope(depth: Tensor, axis: int) -> Tensor:
    """Central differences of depth per pixel; 0 at the border and beside missing pixels."""
    size = depth.shape[axis] - 2
    if size < 1:
        return torch.zeros_like(depth)
    before, after = depth.narrow(axis, 0, size), depth.narrow(axis, 2, size)
    middle = torch.where((before > 0) & (after > 0), (after - before) / 2, 0.0)
    slope = torch.zeros_like(depth)
    slope.narrow(axis, 1, size).copy_(middle)
    return slope


def _uniform(depth: Tensor, generator: torch.Generator) -> Tensor:
    return torch.rand(depth.shape, generator=generator, device=depth.device)


def _require(condition: bool, name: str, value: float, expected: str) -> None:
    if not condition:
        raise ConfigError(f"Kinect noise has {name} = {value}; expected {expected}")
