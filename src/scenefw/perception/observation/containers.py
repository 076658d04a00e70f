"""Bins, trays and crates: walls about what stands in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError

from scenefw.perception.observation.components import EDGE, depth_parts
from scenefw.perception.observation.pixels import coarse_step
from scenefw.perception.observation.points import MAJORITY, MIN_PARALLEL_COSINE, MINORITY, STRAYS
from scenefw.perception.observation.raster import CELL, GAP, FloorRaster
from scenefw.perception.observation.walls import Wall, find_walls, surface_normals

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Float64

    Mask = NDArray[np.bool_]

_RASTER = FloorRaster()
_MIN_RECTANGULARITY = (4 + np.pi) / 8  # of areas: halfway from a circle to a rectangle


@dataclass(frozen=True, eq=False)
class _Side:
    """A wall at the border of a connected surface.

    Args:
        wall: seen from within or from outside.
        inward: 1 where its visible face looks at the rest of the surface, else -1.
    """

    wall: Wall
    inward: float

    def depth(self, places: Float64) -> Float64:
        """How far places (..., 2) lie on the inner side (m)."""
        return self.inward * self.wall.distance(places)


def container_pixels(
    depth: Float32,
    points: Float64,
    raised: Mask,
    eye: Float64,
    wall_distance: float,
    max_size: float,
    min_pixels: float,
) -> Mask:
    """Pixels (H, W) of containers, without what is in them, which may touch their walls.

    A camera sees the faces of solid things that look outwards. Of what is open it sees faces that
    look at the rest of it. So a connected surface that is a rectangle from above is a container if
    walls with such faces bound it along two directions; so is a ring about other surfaces. An
    empty small one is a thing.

    Args:
        depth: (H, W) metres.
        points: (H, W, 3) of the pixels (m), floor z = 0, NaN = no depth.
        raised: (H, W) pixels of what rises above the floor.
        eye: (3,) where the camera is (m).
        wall_distance: points this close to a wall lie on it (m).
        max_size: of a thing, along the floor (m).
        min_pixels: connected surfaces of fewer are none.
    """
    mask = np.zeros(raised.shape, dtype=bool)
    components = depth_parts(depth, raised, EDGE)
    components[np.isnan(points[..., 2])] = 0
    sizes = np.bincount(components.ravel())
    stride = coarse_step(raised.shape[1])
    normals = surface_normals(points[::stride, ::stride])
    for label, box in enumerate(ndimage.find_objects(components), start=1):
        if sizes[label] < min_pixels:
            continue
        pixels, places = components[box] == label, points[box][..., :2]
        neighbours = raised[box] & ~pixels
        coarse_box = tuple(slice(-(-s.start // stride), -(-s.stop // stride)) for s in box)
        surface = components[::stride, ::stride][coarse_box] == label
        surface_points = points[::stride, ::stride][coarse_box]
        sides = _open_sides(surface_points, normals[coarse_box], surface, eye, wall_distance)
        if not sides:
            if _is_ring(points[box][pixels], points[box][neighbours], min_pixels):
                mask[box] |= pixels
            continue
        inner = np.min([side.depth(places) for side in sides], axis=0)
        pieces = depth_parts(depth[box], pixels & (inner > wall_distance), EDGE)
        areas = np.bincount(pieces.ravel())
        far_areas = np.bincount(pieces.ravel(), (inner > 2 * wall_distance).ravel())
        are_contents = (far_areas > MAJORITY * areas) & (areas >= min_pixels)  # no crumbs of walls
        are_contents[0] = False
        contents = are_contents[pieces]
        is_full = contents.any() or (neighbours & (inner > wall_distance)).sum() >= min_pixels
        if is_full or np.ptp(places[pixels], axis=0).max() > max_size:
            mask[box] |= pixels & ~contents
    return mask


def _open_sides(
    points: Float64, normals: Float64, surface: Mask, eye: Float64, wall_distance: float
) -> list[_Side]:
    """All sides of a connected surface, if it is an open rectangle; none otherwise.

    Args:
        points: (H, W, 3) metres.
        normals: (H, W, 3) into the surface, as of `surface_normals`, NaN at edges.
        surface: (H, W) its pixels.
        eye: (3,) where the camera is (m).
        wall_distance: points this close to a wall lie on it (m).
    """
    places = points[surface][:, :2]
    if not len(places):
        return []
    is_steep = surface & (np.abs(normals[..., 2]) < MIN_PARALLEL_COSINE)
    from_middle = points[..., :2] - places.mean(axis=0)
    is_inward = is_steep & ((normals[..., :2] * from_middle).sum(axis=-1) > 0)
    if is_inward.sum() <= MINORITY * is_steep.sum() or not _is_rectangle(places):
        return []
    for candidates in (is_inward, surface):  # few look inward where nothing is open
        walls = find_walls(points, candidates, wall_distance, eye, MIN_PARALLEL_COSINE)
        sides = [side for wall in walls for side in _sides(wall, places)]
        inner = [side.wall.normal for side in sides if side.inward > 0]
        if not any(abs(a @ b) < MIN_PARALLEL_COSINE for a in inner for b in inner):
            return []
    return sides


def _sides(wall: Wall, places: Float64) -> list[_Side]:
    """The wall as a side of a surface with places (N, 2), if it bounds it along most of it."""
    along = places @ np.array([-wall.normal[1], wall.normal[0]])
    if wall.length <= MAJORITY * np.ptp(np.quantile(along, (STRAYS, 1 - STRAYS))):
        return []
    sides = [_Side(wall, inward) for inward in (1.0, -1.0)]
    max_rim = GAP * CELL  # beyond the inner face of a wall
    return [side for side in sides if np.mean(side.depth(places) < -max_rim) < STRAYS]


def _is_rectangle(places: Float64) -> bool:
    """Whether the convex hull of places (N, 2) fills the smallest rectangle about it."""
    from trimesh.bounds import oriented_bounds_2D

    try:
        hull = ConvexHull(places)
    except (QhullError, ValueError):  # all on a line, or hardly any
        return False
    area = hull.volume  # in two dimensions
    return bool(area > _MIN_RECTANGULARITY * np.prod(oriented_bounds_2D(places[hull.vertices])[1]))


def _is_ring(points: Float64, neighbours: Float64, min_pixels: float) -> bool:
    """Whether points (N, 3) are a ring, from above, with enough neighbours (M, 3) in its hole."""
    places = points[:, :2]
    inside = (
        (neighbours[:, :2] > places.min(axis=0)) & (neighbours[:, :2] < places.max(axis=0))
    ).all(axis=1)
    if inside.sum() < min_pixels:
        return False
    footprint = ndimage.binary_closing(_RASTER.count(points) > 0, iterations=GAP)
    filled = ndimage.binary_fill_holes(footprint)
    hole = filled & ~footprint
    is_wide = hole.sum() > MAJORITY * filled.sum()
    return bool(is_wide and _RASTER.look_up(hole, neighbours[inside]).sum() >= min_pixels)
