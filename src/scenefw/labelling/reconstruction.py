"""How well a height map is reconstructed, on which the hybrid's trust in its labels depends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter

from scenefw.core.settings import COUNT, POSITIVE

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.types import Float32


class Reconstruction:
    """How well a map is reconstructed about each vertex, from 0 to 1.

    The mean, over the network's receptive field, of c / (c + c0) * s0^2 / (s^2 + s0^2), with c the
    confidence and s^2 the variance of a vertex, and 0 where it is unseen: the share of its context
    that a network sees, with vertices weighted by their reliability.

    Args:
        confidence: c0, at which a vertex counts half (sum of weights of measurements).
        deviation: s0, at which a vertex counts half (m).
        window: side of the receptive field (vertices).
    """

    def __init__(self, confidence: float = 1.0, deviation: float = 0.003, window: int = 91) -> None:
        POSITIVE.require(confidence=confidence, deviation=deviation)
        COUNT.require(window=window)
        self.confidence = confidence
        self.deviation = deviation
        self.window = window

    def of(self, height_map: HeightMap) -> Float32:
        """(V, V) float32 in [0, 1]."""
        certainty = height_map.confidence / (height_map.confidence + self.confidence)
        limit = np.float32(self.deviation**2)
        spread = np.nan_to_num(height_map.variance, nan=0.0, posinf=np.inf)
        reliable = np.where(height_map.seen, certainty * limit / (spread + limit), 0).astype(
            np.float32
        )
        size = min(self.window, *reliable.shape)
        smooth: Float32 = uniform_filter(reliable, size, mode="nearest").clip(0, 1)
        return smooth
