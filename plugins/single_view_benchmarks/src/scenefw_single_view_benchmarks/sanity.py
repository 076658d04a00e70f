"""What is odd about a predicted object, without any truth: where it is, how long, in free space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from scenefw.core.types import Camera, Float32, Float64

Mask = NDArray[np.bool_]

# Chosen with a look at real predictions: what is beyond is wrong for whoever sees it
MAX_BELOW = 0.02  # m below the floor
MAX_LENGTH_RATIO = 2.0  # of the longest side, by that of what is visible
MIN_LENGTH = 0.08  # m: shorter objects may be longer than what is visible
MAX_FREE_RATIO = 0.2  # of the volume
MIN_FREE_DISTANCE = 0.015  # m in front of the measured surface: what is nearer may be noise
MAX_GAP = 0.012  # m between an object and what it stands on
MIN_PIXELS = 10  # with depth: fewer don't show an object

_BOTTOM = 0.01  # m above its lowest point, what an object stands on


@dataclass(frozen=True)
class Sanity:
    """Measures of one object.

    Args:
        below: how far it reaches below the floor z = 0 (m).
        length: its longest side along the axes of the world (m).
        visible_length: the same of its visible points (m).
        free_ratio: share of its volume that the camera looks through.
        gap: between its bottom and the floor, or the nearest other object (m).
        pixels: that show it, with depth.
    """

    below: float
    length: float
    visible_length: float
    free_ratio: float
    gap: float
    pixels: int

    @property
    def flags(self) -> frozenset[str]:
        """What is odd: `below`, `long`, `free`, `hovering`, `unseen`; empty for most objects."""
        is_seen = self.pixels > MIN_PIXELS
        odd = {
            "below": self.below > MAX_BELOW,
            "long": is_seen
            and self.length > max(MAX_LENGTH_RATIO * self.visible_length, MIN_LENGTH),
            "free": self.free_ratio > MAX_FREE_RATIO,
            "hovering": self.gap > MAX_GAP,
            "unseen": not is_seen,
        }
        return frozenset(name for name, is_odd in odd.items() if is_odd)


FLAGS = ("below", "long", "free", "hovering", "unseen")
"""Names of what may be odd."""


def sanity(
    vertices: Float64,
    interior: Float64,
    visible: Float64,
    others: Float64,
    depth: Float32,
    camera: Camera,
) -> Sanity:
    """Measures of an object in a scene whose floor is z = 0.

    Args:
        vertices: (V, 3) of its surface (m).
        interior: (N, 3) spread evenly over its volume (m).
        visible: (P, 3) of the pixels that show it (m).
        others: (Q, 3) on the surfaces of all other objects (m).
        depth: (H, W) of the whole image (m), 0 = no measurement.
        camera: of the image, with its pose above the floor.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    bottom = vertices[vertices[:, 2] < low[2] + _BOTTOM]
    to_others = cKDTree(others).query(bottom)[0].min() if len(others) else np.inf
    return Sanity(
        below=float(max(-low[2], 0.0)),
        length=float((high - low).max()),
        visible_length=float(np.ptp(visible, axis=0).max()) if len(visible) else 0.0,
        free_ratio=float(in_free_space(interior, depth, camera).mean()) if len(interior) else 0.0,
        gap=float(max(min(low[2], to_others), 0.0)),
        pixels=len(visible),
    )


def in_free_space(points: Float64, depth: Float32, camera: Camera) -> Mask:
    """Which points (N, 3) the camera looks through, as it measures something behind them (N,)."""
    pose = camera.T_world_camera
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    is_before = local[:, 2] > 0
    z = np.where(is_before, local[:, 2], 1.0)
    column = np.rint(camera.fx * local[:, 0] / z + camera.cx)
    row = np.rint(camera.fy * local[:, 1] / z + camera.cy)
    height, width = depth.shape
    in_image = is_before & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    measured = np.zeros(len(points))
    pixels = row[in_image].astype(int), column[in_image].astype(int)
    measured[in_image] = depth[pixels]
    return np.asarray(measured > local[:, 2] + MIN_FREE_DISTANCE) & in_image
