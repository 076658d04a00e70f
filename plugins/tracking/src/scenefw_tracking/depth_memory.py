"""Depth that a still camera has measured, and which pixels of a later image differ from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import binary_opening, maximum_filter, minimum_filter

from scenefw.perception.observation.floor_noise import ROUNDING, floor_sigma
from scenefw.perception.observation.pixels import scaled
from scenefw.perception.observation.points import rays

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32
    from scenefw.perception.observation.observation import Observation

    Mask = NDArray[np.bool_]
    Box = tuple[slice, slice]

_SIGMAS = 5.0
"""Standard deviations of two measurements' difference: noise exceeds it in one of two million
pixels, so in none of an image that hasn't changed."""


@dataclass(frozen=True, eq=False)
class DepthMemory:
    """Between which depths a pixel still shows what it has shown.

    Where an object ends, it may also show what its neighbours have shown.

    Args:
        lower: (H, W) least depth (m), infinite where nothing was measured.
        upper: (H, W) greatest depth (m), 0 there.
        reach: pixels from the middle to the side of the smallest square that counts as a change.
        sigma: standard deviation of depth at 1 m (m); it grows with depth squared.
    """

    lower: Float32
    upper: Float32
    reach: int
    sigma: float

    @classmethod
    def of(cls, depth: Float32, sigma: float) -> DepthMemory:
        """The memory of an image.

        Args:
            depth: (H, W) metres, 0 = no measurement.
            sigma: standard deviation of depth at 1 m (m); it grows with depth squared.
        """
        reach = scaled(1, depth.shape[1])  # edges move by a pixel from image to image
        side = 2 * reach + 1
        limit = smallest_change(depth, sigma)
        measured = depth > 0
        return cls(
            minimum_filter(np.where(measured, depth - limit, np.float32(np.inf)), side),
            maximum_filter(np.where(measured, depth + limit, np.float32(0)), side),
            reach,
            sigma,
        )

    def __getitem__(self, box: Box) -> DepthMemory:
        """The same of a part of the image."""
        return DepthMemory(self.lower[box], self.upper[box], self.reach, self.sigma)

    def matches(self, depth: Float32) -> Mask:
        """Pixels (H, W) that show the same."""
        return (depth >= self.lower) & (depth <= self.upper)

    def nearer(self, depth: Float32) -> Mask:
        """Pixels (H, W) that show something in front of it."""
        return self.cleaned((depth < self.lower) & (depth > 0) & (self.upper > 0))

    def farther(self, depth: Float32, mask: Mask | None = None) -> Mask:
        """Pixels (H, W), of a mask if there is one, that show what is behind it."""
        beyond = (depth > self.upper) & (self.upper > 0)
        return self.cleaned(beyond if mask is None else beyond & mask)

    def cleaned(self, pixels: Mask) -> Mask:
        """Pixels (H, W) of a mask that are in a square of it, as no jitter of edges is."""
        if not pixels.any():
            return pixels
        return np.asarray(binary_opening(pixels, np.ones((2 * self.reach + 1,) * 2, bool)))


def smallest_change(depth: Float32, sigma: float) -> Float32:
    """Difference (m) of two measurements of depths (m) that noise doesn't explain.

    Args:
        depth: metres.
        sigma: standard deviation at 1 m (m).
    """
    return np.float32(_SIGMAS * np.sqrt(2) * sigma) * depth**2


def depth_sigma(view: Observation) -> float:
    """Standard deviation (m) of depth along the camera's axis at 1 m, as the floor shows it.

    Depth is `ROUNDING` off at least. Where little of the floor is visible, its root mean square
    distance from a plane says it.
    """
    slope = np.abs(rays(view.camera) @ view.camera.T_world_camera[2, :3])  # of height by depth
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma = floor_sigma(view.heights / slope, view.depth)
    if not sigma and view.floor is not None:
        sigma = view.floor.deviation
    return max(sigma, ROUNDING)
