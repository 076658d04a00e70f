"""The Kinect noise in whole-array torch operations, drawing from a torch generator."""

import torch

from scenefw.noise.kinect import Kinect


def kinect(depth, cameras, generator, **settings):
    """Noisy depth (B, H, W) of all images."""
    return Reference(settings).apply(depth, cameras, generator)


class Reference:
    def __init__(self, settings):
        self.__dict__.update(vars(Kinect(**settings)))

    def apply(self, depth, cameras, generator):
        lit = torch.where(self._shadow(depth, cameras), 0.0, depth)
        lit = torch.where(self._grazing(depth, cameras, generator), 0.0, lit)
        shifted = self._shift(lit, generator)
        noisy = self._axial(shifted, generator)
        stepped = self._steps(noisy, cameras)
        keep = (stepped >= self.nearest) & (stepped <= self.farthest) & (shifted > 0)
        keep &= _uniform(depth, generator) >= self.dropout
        disturbed = _uniform(depth[:, :1, :1], generator) < self.share
        return torch.where(disturbed, torch.where(keep, stepped, 0.0), depth)

    def _disparity(self, depth, cameras):
        focal = cameras.intrinsics[:, 0, None, None]
        return focal * abs(self.baseline) / depth.clamp(min=1e-6)

    def _shadow(self, depth, cameras):
        """Where something that the projector sees in the same direction is nearer to the camera."""
        columns = torch.arange(depth.shape[2], device=depth.device, dtype=depth.dtype)
        disparity = self._disparity(depth, cameras)
        if self.baseline < 0:
            columns, disparity = columns.flip(0), disparity.flip(2)
            shadow = _hidden(columns.max() - columns - disparity, depth.flip(2))
            return shadow.flip(2)
        return _hidden(columns - disparity, depth)

    def _grazing(self, depth, cameras, generator):
        """Random pixels, more of them the more the ray grazes the surface."""
        angle = _incidence(depth, cameras)
        share = (angle - self.grazing_from) / (self.grazing_to - self.grazing_from)
        return _uniform(depth, generator) < share

    def _shift(self, depth, generator):
        """Each pixel's depth replaced by that of a pixel nearby."""
        batch, height, width = depth.shape
        shape = (2, batch, height, width)
        noise = torch.randn(shape, generator=generator, device=depth.device)
        shift = (self.lateral * noise).round().to(torch.int64)
        rows = torch.arange(height, device=depth.device)[:, None] + shift[0]
        columns = torch.arange(width, device=depth.device) + shift[1]
        at = rows.clamp(0, height - 1) * width + columns.clamp(0, width - 1)
        return depth.flatten(1).gather(1, at.flatten(1)).view_as(depth)

    def _axial(self, depth, generator):
        sigma = self.axial * (0.0012 + 0.0019 * (depth - 0.4) ** 2)
        noise = torch.randn(depth.shape, generator=generator, device=depth.device)
        return (depth + sigma * noise.to(depth.dtype)).clamp(min=1e-6)

    def _steps(self, depth, cameras):
        """Depth whose disparity is a multiple of the step; 0 where that is no step at all."""
        count = (self._disparity(depth, cameras) / self.disparity_step).round()
        focal = cameras.intrinsics[:, 0, None, None]
        stepped = focal * abs(self.baseline) / (count.clamp(min=1) * self.disparity_step)
        return torch.where(count > 0, stepped, 0.0)


def _hidden(position, depth):
    """Where a pixel farther right in the row lies farther left (by a pixel) for the projector."""
    blocking = torch.where(depth > 0, position, torch.inf)
    leftmost = blocking.flip(2).cummin(dim=2).values.flip(2)
    return position > leftmost + 1


def _incidence(depth, cameras):
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


def _slope(depth, axis):
    """Central differences of depth per pixel; 0 at the border and beside missing pixels."""
    size = depth.shape[axis] - 2
    if size < 1:
        return torch.zeros_like(depth)
    before, after = depth.narrow(axis, 0, size), depth.narrow(axis, 2, size)
    middle = torch.where((before > 0) & (after > 0), (after - before) / 2, 0.0)
    slope = torch.zeros_like(depth)
    slope.narrow(axis, 1, size).copy_(middle)
    return slope


def _uniform(depth, generator):
    return torch.rand(depth.shape, generator=generator, device=depth.device)
