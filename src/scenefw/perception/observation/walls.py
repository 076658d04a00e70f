"""Large vertical planes in a depth image: walls of rooms and of bins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core import rng
from scenefw.perception.observation.pixels import BLUR, coarse_step
from scenefw.perception.observation.points import (
    DRAWS,
    MAJORITY,
    MIN_PARALLEL_COSINE,
    MIN_POINTS,
    REFINEMENTS,
    SAMPLE,
)
from scenefw.perception.observation.raster import CELL, GAP

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from scenefw.core.types import Float64

    Mask = NDArray[np.bool_]

_MAX_UPWARD = np.sin(np.arccos(MIN_PARALLEL_COSINE))  # of normals of vertical surfaces


@dataclass(frozen=True, eq=False)
class Wall:
    """A part of a vertical plane.

    Args:
        normal: (2,) horizontal unit, towards the camera.
        offset: a place p (2,) lies `normal @ p - offset` before it (m).
        ends: positions of its ends along (-normal[1], normal[0]) (m).
    """

    normal: Float64
    offset: float
    ends: tuple[float, float]

    @property
    def length(self) -> float:
        """In metres."""
        return self.ends[1] - self.ends[0]

    def distance(self, places: Float64) -> Float64:
        """How far places (..., 2) lie before the wall (m)."""
        return places @ self.normal - self.offset

    def beside(self, places: Float64) -> Mask:
        """Which places (..., 2) lie between the wall's ends, before or behind it."""
        position = places @ np.array([-self.normal[1], self.normal[0]])
        mask: Mask = (position > self.ends[0] - CELL) & (position < self.ends[1] + CELL)
        return mask


def find_walls(
    points: Float64, raised: Mask, distance: float, eye: Float64, max_upward: float = _MAX_UPWARD
) -> Iterator[Wall]:
    """Vertical planes, those with most points first; of each the longest part without a gap.

    Lines through one of the points seen from above, across its normal, are tried at random; the
    one with most points whose normals agree is fitted, and the next is looked for in the rest. The
    same image has the same walls.

    Args:
        points: (H, W, 3) metres, floor z = 0, NaN = no depth.
        raised: (H, W) pixels that may lie on a wall.
        distance: of its points from a wall at most (m).
        eye: (3,) where the camera is (m).
        max_upward: of unit normals along z: 0.35 are 20 degrees.
    """
    stride = coarse_step(points.shape[1])
    points, raised = points[::stride, ::stride], raised[::stride, ::stride]
    normals = surface_normals(points)
    surfaces = raised & np.isfinite(normals[..., 0])
    vertical = surfaces & (np.abs(normals[..., 2]) < max_upward)
    stride = max(1, int(vertical.sum()) // SAMPLE)
    places, directions = (a[vertical][::stride, :2] for a in (points, normals))
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    random = rng.generator(0)
    while len(places) >= MIN_POINTS:
        normal, offset = _best_line(places, directions, distance, random)
        for _ in range(REFINEMENTS):
            inliers = _on_line(places, directions, normal, offset, distance)
            if inliers.sum() < MIN_POINTS:
                return
            centre = places[inliers].mean(axis=0)
            normal = np.linalg.svd(places[inliers] - centre, full_matrices=False)[2][-1]
            offset = float(normal @ centre)
        side = 1.0 if normal @ eye[:2] > offset else -1.0
        normal, offset = side * normal, side * offset
        inliers = _on_line(places, directions, normal, offset, distance)
        if not inliers.any():
            return
        wall = Wall(normal, offset, _longest_run(places[inliers] @ (-normal[1], normal[0])))
        near = surfaces & wall.beside(points[..., :2])
        near &= np.abs(wall.distance(points[..., :2])) < distance
        # a plane through a heap cuts most surfaces
        if _aligned(normals[near], normal, max_upward).mean() > MAJORITY:
            yield wall
        places, directions = places[~inliers], directions[~inliers]


def surface_normals(points: Float64) -> Float64:
    """Unit normals (H, W, 3), away from the camera, by cross products of differences, NaN at edges.

    Args:
        points: (H, W, 3) metres, NaN = no depth.
    """
    k = BLUR
    normals = np.full(points.shape, np.nan)
    if min(points.shape[:2]) <= 2 * k:
        return normals
    across = points[k:-k, 2 * k :] - points[k:-k, : -2 * k]
    down = points[2 * k :, k:-k] - points[: -2 * k, k:-k]
    cross = np.cross(across, down)
    length = np.linalg.norm(cross, axis=-1)
    normals[k:-k, k:-k] = cross / np.where(length == 0, np.nan, length)[..., None]
    return normals


def _best_line(
    places: Float64, directions: Float64, distance: float, random: np.random.Generator
) -> tuple[Float64, float]:
    chosen = random.integers(len(places), size=DRAWS)
    normals = directions[chosen]
    offsets = np.einsum("ij,ij->i", normals, places[chosen])
    near = np.abs(normals @ places.T - offsets[:, None]) < distance
    aligned = np.abs(normals @ directions.T) > MIN_PARALLEL_COSINE
    best = int((near & aligned).sum(axis=1).argmax())
    return normals[best], float(offsets[best])


def _on_line(
    places: Float64, directions: Float64, normal: Float64, offset: float, distance: float
) -> Mask:
    mask: Mask = np.abs(directions @ normal) > MIN_PARALLEL_COSINE
    return mask & (np.abs(places @ normal - offset) < distance)


def _aligned(normals: Float64, wall_normal: Float64, max_upward: float) -> Mask:
    """Which normals (N, 3) a wall may have."""
    horizontal = np.linalg.norm(normals[:, :2], axis=1)
    mask: Mask = np.abs(normals[:, :2] @ wall_normal) > MIN_PARALLEL_COSINE * horizontal
    return mask & (np.abs(normals[:, 2]) < max_upward)


def _longest_run(along: Float64) -> tuple[float, float]:
    """Where the longest part of a line without a gap begins and ends (m)."""
    cells = np.unique(np.floor(along / CELL))
    runs = np.split(cells, np.flatnonzero(np.diff(cells) > GAP + 1) + 1)
    run = max(runs, key=len)
    return float(run[0] * CELL), float((run[-1] + 1) * CELL)
