"""Obstacles by their geometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage
from skimage.morphology import convex_hull_image

from scenefw.core.settings import COUNT, POSITIVE
from scenefw.perception.observation.components import EDGE, across_gaps, depth_parts
from scenefw.perception.observation.containers import container_pixels
from scenefw.perception.observation.obstacles import ObstacleRegion
from scenefw.perception.observation.pixels import BLUR, WIDTH, scaled
from scenefw.perception.observation.points import MAJORITY, MIN_PARALLEL_COSINE, STRAYS
from scenefw.perception.observation.raster import GAP, FloorRaster
from scenefw.perception.observation.walls import Wall, find_walls

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Float64, Frame

    Mask = NDArray[np.bool_]

_RASTER = FloorRaster()


@dataclass(frozen=True, eq=False)
class GeometricObstacles:
    """Takes what is too large to be a thing on a table for an obstacle, and containers.

    Of connected surfaces, those are obstacles that enclose much floor, as rims of trays do, or that
    rise too high. Vertical planes that are too long are walls; with them go the walls of the same
    bin, which accompany the floor's other sides, and all that is behind a wall.

    Args:
        max_size: of a thing on a table, along the floor (m).
        max_height: of things on a table, above its floor (m).
        wall_distance: points this close to a wall lie on it (m).
        min_pixels: connected surfaces of fewer (of an image 640 wide) are none.

    Raises:
        ConfigError: a length that isn't positive, a share outside 0..1, or less than one pixel.
    """

    max_size: float
    max_height: float
    wall_distance: float
    min_pixels: float

    def __post_init__(self) -> None:
        POSITIVE.require(max_size=self.max_size, max_height=self.max_height)
        POSITIVE.require(wall_distance=self.wall_distance)
        COUNT.require(min_pixels=self.min_pixels)

    def find(
        self, frame: Frame, points: Float64, raised: Mask, floor: Mask
    ) -> list[ObstacleRegion]:
        """Obstacles, which share no pixel.

        Args:
            frame: whose floor is z = 0.
            points: (H, W, 3) of the pixels (m), NaN = no depth.
            raised: (H, W) pixels of what rises above the floor.
            floor: (H, W) pixels of the floor.
        """
        depth, eye = frame.depth, frame.camera.T_world_camera[:3, 3]
        min_pixels = self.min_pixels * (depth.shape[1] / WIDTH) ** 2
        enclosures = container_pixels(
            depth, points, raised, eye, self.wall_distance, self.max_size, min_pixels
        )
        enclosures |= self._components(points, self._encloses, depth, raised & ~enclosures)
        candidates = raised & ~enclosures
        walls = self._wall_mask(points, candidates, floor, eye, in_bin=bool(enclosures.any()))
        candidates &= ~walls
        closed = across_gaps(depth, candidates, scaled(BLUR, depth.shape[1]))
        tall = candidates & self._components(points, self._is_tall, *closed)
        kinds = {"enclosure": enclosures, "wall": walls, "tall structure": tall}
        return [ObstacleRegion(kind, pixels) for kind, pixels in kinds.items() if pixels.any()]

    def _components(
        self,
        points: Float64,
        is_obstacle: Callable[[Float64], bool],
        depth: Float32,
        raised: Mask,
    ) -> Mask:
        """Pixels of the connected surfaces that are obstacles, by their points (N, 3)."""
        components = depth_parts(depth, raised, EDGE)
        components[np.isnan(points[..., 2])] = 0
        sizes = np.bincount(components.ravel())
        are_obstacles = np.zeros(len(sizes), dtype=bool)
        min_pixels = self.min_pixels * (depth.shape[1] / WIDTH) ** 2
        for label, box in enumerate(ndimage.find_objects(components), start=1):
            if sizes[label] >= min_pixels:
                are_obstacles[label] = is_obstacle(points[box][components[box] == label])
        mask: Mask = are_obstacles[components]
        return mask

    def _is_tall(self, points: Float64) -> bool:
        return bool(np.quantile(points[:, 2], 1 - STRAYS) > self.max_height)

    def _encloses(self, points: Float64) -> bool:
        """Whether a footprint is a ring about a floor, as seen from above."""
        if np.ptp(points[:, :2], axis=0).max() <= self.max_size or self._is_tall(points):
            return False
        footprint = ndimage.binary_closing(_RASTER.count(points) > 0, iterations=GAP)
        if not footprint.any():  # farther away than the raster reaches
            return False
        hull = convex_hull_image(footprint)
        return bool((hull & ~footprint).sum() > MAJORITY * hull.sum())

    def _wall_mask(
        self, points: Float64, raised: Mask, floor: Mask, eye: Float64, *, in_bin: bool
    ) -> Mask:
        """Pixels (H, W) on walls and behind them."""
        places, floor_places = points[..., :2], points[floor][:, :2]
        candidates = find_walls(points, raised, self.wall_distance, eye)
        walls = [wall for wall in candidates if wall.length > self.max_size]
        if walls or in_bin:
            # of a bin's, all that isn't level
            slopes = find_walls(points, raised, self.wall_distance, eye, MIN_PARALLEL_COSINE)
            walls += [wall for wall in slopes if _is_side(wall, floor_places)]
        mask = np.zeros(raised.shape, dtype=bool)
        for wall in walls:
            distance = wall.distance(places)
            mask |= np.abs(distance) < self.wall_distance
            if len(floor_places) and np.mean(wall.distance(floor_places) < 0) < STRAYS:
                mask |= wall.beside(places) & (distance < 0)
        return mask & raised


def _is_side(wall: Wall, floor: Float64) -> bool:
    """Whether a wall ends the floor (N, 2), along much of its side."""
    if not len(floor):
        return False
    along = floor @ np.array([-wall.normal[1], wall.normal[0]])
    return bool(
        wall.length > MAJORITY * np.ptp(np.quantile(along, (STRAYS, 1 - STRAYS)))
        and np.mean(wall.distance(floor) < 0) < STRAYS
    )
