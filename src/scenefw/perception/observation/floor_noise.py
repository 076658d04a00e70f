"""How noisy a floor looks, and whether errors of neighbouring pixels are alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from scenefw.perception.observation.components import EDGE
from scenefw.perception.observation.pixels import scaled
from scenefw.perception.observation.points import MIN_POINTS, MINORITY

if TYPE_CHECKING:
    from scenefw.core.types import Float32, Float64

_REACH = 7.0  # standard deviations: waves of correlated errors are as high as flat things
_MIN_CORRELATION = 0.92  # stereo matching has 0.95 to 0.99, structured light at most 0.9
MAX_FLOOR_HEIGHT = 0.015
"""m above and below the floor: what is farther away isn't the floor."""
ROUNDING = 1e-5
"""No measurement is as close to the floor (m), over many pixels."""


@dataclass(frozen=True)
class FloorNoise:
    """Errors of the heights of a floor.

    Args:
        sigma: robust standard deviation at a depth of 1 m (m); it grows with depth squared, as
            errors of triangulation do. 0 if little of the floor is visible.
        is_correlated: errors of neighbouring pixels correlate, as in stereo matching and not in
            structured light.
    """

    sigma: float
    is_correlated: bool

    @classmethod
    def of(cls, heights: Float64, depth: Float32) -> FloorNoise:
        """The noise of an image.

        Args:
            heights: (H, W) metres above the floor, NaN = no depth.
            depth: (H, W) metres.
        """
        return cls(floor_sigma(heights, depth), has_correlated_noise(heights))

    def at(self, depth: Float32) -> Float64:
        """Standard deviations (m) of heights at depths (m)."""
        return np.asarray(self.sigma * depth.astype(np.float64) ** 2)

    def reach(self, depth: Float32) -> Float64:
        """Heights (m) up to which errors may lift many neighbouring pixels, at depths (m).

        Independent errors lift single pixels alone, none of which counts.
        """
        reach = _REACH * self.at(depth)
        return reach if self.is_correlated else np.minimum(reach, MAX_FLOOR_HEIGHT)


def has_correlated_noise(heights: Float64) -> bool:
    """True if height errors of neighbouring floor pixels correlate, as in stereo matching.

    In images wider than 640 pixels, pixels are compared that many times further apart.

    Args:
        heights: (H, W) metres above the floor, NaN = no depth.
    """
    correlations, step = [], scaled(1, heights.shape[1])
    columns = heights[:, step:], heights[:, :-step]
    for first, second in ((heights[step:], heights[:-step]), columns):
        on_floor = (np.abs(first) < MAX_FLOOR_HEIGHT) & (np.abs(second) < MAX_FLOOR_HEIGHT)
        min_pixels = max(MIN_POINTS, MINORITY * on_floor.sum())
        on_floor &= (np.abs(first) > ROUNDING) & (np.abs(second) > ROUNDING)
        if on_floor.sum() < min_pixels:
            return False
        correlations.append(np.corrcoef(first[on_floor], second[on_floor])[0, 1])
    return bool(np.mean(correlations) > _MIN_CORRELATION)


def robust_sigma(errors: Float64) -> float:
    """Standard deviation of errors about 0, by their median size."""
    return float(np.median(np.abs(errors)) / ndtri(3 / 4))


def floor_sigma(heights: Float64, depth: Float32) -> float:
    """Robust standard deviation (m) of the floor's heights at a depth of 1 m; 0 if little is seen.

    Only what lies below z = 0 counts: above it may be objects. What lies on it exactly has been
    moved there, from beyond the table.

    Args:
        heights: (H, W) metres, NaN = no depth.
        depth: (H, W) metres.
    """
    below = (heights < -ROUNDING) & (heights > -EDGE)
    if below.sum() < MIN_POINTS:
        return 0.0
    return robust_sigma(heights[below] / depth[below] ** 2)
