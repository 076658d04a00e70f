"""Noise of an active stereo camera: disparity that waves and is smoothed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from scenefw.core.rng import Streams
from scenefw.core.settings import NOT_NEGATIVE, POSITIVE, SHARE
from scenefw.kernels.cameras import finite

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.batches import CameraBatch

_LEAST = 1e-3  # pixels of disparity
_AROUND = (2, 4, 6)  # pixels to neighbours that say how much of a window matches
_DEVIATION = 0.855  # of unit normals after bicubic interpolation, over all places


class Stereo:
    """Disturbs depth like a camera that matches windows of two images.

    Windows make neighbours agree: errors are smooth, so that a flat floor waves, and creases are
    rounded. The disparity, focal length times baseline by depth, is averaged over a window, where
    the surface is in one piece; then smooth Gaussian fields of several wavelengths are added. In
    depth they grow with its square. Near ends of a surface less of a window matches, so errors are
    larger there; and what the right one of the two cameras doesn't see has no depth. In part of
    the images windows reach across edges: depth leads in a ramp from an object to what is behind.
    How much of all this an image has is drawn for each.

    Args:
        baseline: between both cameras (m).
        waves: standard deviation of the field of each wavelength (pixels of disparity), at most.
        wavelengths: distance of independent values of each field (pixels).
        window: pixels to each side that are averaged, at most.
        jump: pixels of disparity from which neighbours lie on different surfaces.
        edges: by how much of themselves the fields grow where nothing of a window matches.
        shadows: share of the disturbed images that lose what the other camera doesn't see.
        ramps: share of the disturbed images with windows that reach across edges.
        ramp: pixels to each side that are averaged in these, at most.
        across: pixels of disparity of the highest edges that they reach across, at most.
        share: share of the images that are disturbed; the others pass as they are.

    Raises:
        ConfigError: an amount that is negative, or a baseline, wavelength or jump that is 0.
    """

    def __init__(
        self,
        baseline: float = 0.05,
        waves: float = 0.06,
        wavelengths: Sequence[float] = (6.0, 16.0, 48.0),
        window: int = 4,
        jump: float = 0.3,
        edges: float = 1.0,
        shadows: float = 0.7,
        ramps: float = 0.0,
        ramp: int = 6,
        across: float = 3.0,
        share: float = 1.0,
    ) -> None:
        POSITIVE.require(baseline=baseline, jump=jump, across=across, wavelengths=wavelengths)
        NOT_NEGATIVE.require(waves=waves, window=window, ramp=ramp, edges=edges)
        SHARE.require(shadows=shadows, ramps=ramps, share=share)
        self.baseline, self.waves, self.wavelengths = baseline, waves, tuple(wavelengths)
        self.window, self.jump = window, jump
        self.edges, self.shadows, self.share = edges, shadows, share
        self.ramps, self.ramp, self.across = ramps, ramp, across

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 stays 0, the rest is positive or lost."""
        depth = finite(depth.float(), 0.0).clamp_min(0.0).contiguous()
        streams = Streams.of(0, indices=seeds.cpu().numpy())
        chances = streams.uniform(6)
        rows = np.flatnonzero(chances[:, 0] < self.share)
        if not len(rows):
            return depth
        picked = torch.from_numpy(rows).to(depth.device)
        subset = depth[picked]
        valid = subset > 0
        scale = self.baseline * cameras.intrinsics[picked, 0, None, None]
        disparity = torch.where(valid, scale / subset.clamp_min(1e-6), 0.0)
        shadowed = torch.from_numpy(chances[rows, 3] < self.shadows).to(depth.device)
        valid = valid & ~(shadowed[:, None, None] & unseen_from_the_right(disparity))
        windows = [tensor.to(depth.device) for tensor in self._windows(chances[rows])]
        field = self._field(Streams(streams.keys[rows]), depth.shape[1], depth.shape[2])
        field = field.to(depth.device) * self._growth(disparity, valid)
        disparity = self._smoothed(disparity, valid, *windows)
        amounts = torch.from_numpy((self.waves * chances[rows, 2]).astype(np.float32))
        disparity = disparity + amounts.to(depth.device)[:, None, None] * field
        noisy = torch.where(valid, scale / disparity.clamp_min(_LEAST), 0.0)
        return depth.index_copy(0, picked, noisy)

    def _windows(self, chances: NDArray[np.float64]) -> tuple[Tensor, Tensor]:
        """Pixels to each side (B,) that are averaged, and jumps (B, 1, 1) that end a surface."""
        ramps = chances[:, 4] < self.ramps
        max_window = np.where(ramps, self.ramp, self.window)
        reached = self.jump + chances[:, 5] * max(self.across - self.jump, 0.0)
        windows = np.floor(chances[:, 1] * (max_window + 1)).astype(int)
        jumps = np.where(ramps, reached, self.jump).astype(np.float32)
        return torch.from_numpy(windows), torch.from_numpy(jumps)[:, None, None]

    def _growth(self, disparity: Tensor, valid: Tensor) -> Tensor:
        """Factor of the fields (B, H, W): 1 where all of a window matches, more near ends."""
        if not self.edges:
            return torch.ones_like(disparity)
        close = torch.zeros_like(disparity)
        for axis in (2, 1):
            for step in _AROUND:
                for way in (step, -step):
                    same_surface = (_shifted(disparity, way, axis) - disparity).abs() < self.jump
                    close += same_surface & _shifted(valid, way, axis)
        return 1 + self.edges * (1 - close / (4 * len(_AROUND)))

    def _smoothed(self, disparity: Tensor, valid: Tensor, windows: Tensor, jumps: Tensor) -> Tensor:
        """Means over windows (B,) that end at jumps (B, 1, 1), one axis after the other."""
        widest = max(self.window, self.ramp if self.ramps else 0)
        for axis in (2, 1):
            total, count = disparity.clone(), torch.ones_like(disparity)
            for step in range(1, widest + 1):
                for way in (step, -step):
                    neighbour = _shifted(disparity, way, axis)
                    close = _shifted(valid, way, axis) & ((neighbour - disparity).abs() < jumps)
                    close &= (windows >= step)[:, None, None]
                    total += torch.where(close, neighbour, 0.0)
                    count += close
            disparity = torch.where(valid, total / count, 0.0)
        return disparity

    def _field(self, streams: Streams, height: int, width: int) -> Tensor:
        """Smooth Gaussian fields (B, H, W), each wavelength of about unit deviation, on the CPU."""
        total = torch.zeros(len(streams), height, width)
        for length, part in zip(
            self.wavelengths, streams.split(len(self.wavelengths)), strict=True
        ):
            rows, columns = (int(np.ceil(size / length)) + 3 for size in (height, width))
            first, second = np.split(part.uniform(2 * rows * columns), 2, axis=1)
            normal = np.sqrt(-2 * np.log1p(-first)) * np.cos(2 * np.pi * second)
            nodes = torch.from_numpy(normal.astype(np.float32)).view(-1, 1, rows, columns)
            size = (round(rows * length), round(columns * length))
            field = functional.interpolate(nodes, size, mode="bicubic", align_corners=False)
            # Half a node off the edge, where the interpolation repeats the last one
            at = round(length)
            total += field[:, 0, at : at + height, at : at + width] / _DEVIATION
        return total


def unseen_from_the_right(disparity: Tensor) -> Tensor:
    """Which pixels (B, H, W) the right one of two cameras doesn't see.

    There a pixel lies its disparity further left. It is hidden if something further right in this
    image comes to lie on it, or to the left of it: that is nearer.

    Args:
        disparity: (B, H, W) in pixels, 0 = no measurement.
    """
    places = torch.arange(disparity.shape[2], device=disparity.device) - disparity
    places = torch.where(disparity > 0, places, torch.inf)
    leftmost = places.flip(2).cummin(dim=2).values.flip(2)
    after = functional.pad(leftmost[..., 1:], (0, 1), value=torch.inf)
    return (disparity > 0) & (after <= places)


def _shifted(values: Tensor, step: int, axis: int) -> Tensor:
    """Values of the neighbours `step` before along an axis, 0 beyond the image."""
    neighbours = values.roll(step, axis)
    neighbours.narrow(axis, 0 if step > 0 else values.shape[axis] + step, abs(step)).zero_()
    return neighbours
