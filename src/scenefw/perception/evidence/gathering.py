"""What a view says about one object: points of its surface, and places where it isn't."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import binary_erosion, find_objects, maximum_filter
from scipy.spatial import cKDTree

from scenefw.core.evidence import Evidence
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE, above
from scenefw.fitting.placed import OUTLIERS
from scenefw.perception.evidence.silhouettes import passed_places
from scenefw.perception.observation.components import NOISE
from scenefw.perception.observation.pixels import WIDTH
from scenefw.perception.observation.points import MIN_POINTS, MINORITY

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float64, GridSpec, Int32
    from scenefw.perception.observation.observation import ViewGeometry
    from scenefw.perception.steps import Objects

    Mask = NDArray[np.bool_]
    Box = tuple[slice, ...]


class EvidenceGathering:
    """Gathers what a view and a predicted scene say about an object.

    Its seen points are near its surface. Where it isn't seen, the predicted surface is a weak
    hint. It contains no place that was seen free, no point of another object, and nothing below the
    floor.

    Args:
        visible_sigma: standard deviation of seen points from the surface (m).
        hidden_sigma: of predicted ones (m).
        outside_sigma: how deep a place outside may lie in the object (m).
        surface_points: visible points at most, and as many predicted ones.
        outside_points: places of each kind outside, at most.
        border_pixels: width (pixels of an image 640 wide) of the border to another object, whose
            pixels aren't evidence: some are the other's, and a few mislead the fit of a thin
            object.
        passing_points: places outside on rays that pass the object closely, where the camera is
            known.

    Raises:
        ConfigError: a number isn't positive, or predicted points are as certain as seen ones.
    """

    def __init__(
        self,
        visible_sigma: float = 0.003,
        hidden_sigma: float = 0.3,
        outside_sigma: float = 0.004,
        surface_points: int = 200,
        outside_points: int = 100,
        border_pixels: int = 4,
        passing_points: int = 300,
    ) -> None:
        POSITIVE.require(visible_sigma=visible_sigma, outside_sigma=outside_sigma)
        COUNT.require(surface_points=surface_points, outside_points=outside_points)
        sigma_bound = above(visible_sigma, "as what is seen is the more certain")
        sigma_bound.require(hidden_sigma=hidden_sigma)
        NOT_NEGATIVE.require(border_pixels=border_pixels, passing_points=passing_points)
        self.visible_sigma, self.hidden_sigma = visible_sigma, hidden_sigma
        self.outside_sigma = outside_sigma
        self.surface_points, self.outside_points = surface_points, outside_points
        self.border_pixels, self.passing_points = border_pixels, passing_points

    @property
    def of_segments(self) -> EvidenceGathering:
        """The same for segments: what lies beside one may be of the same object."""
        gathering = copy(self)
        gathering.border_pixels = gathering.passing_points = 0
        return gathering

    def of(self, label: int, objects: Objects, view: ViewGeometry) -> Evidence:
        """The evidence about the object with this label; it may have no points."""
        return self.of_each([[label]], objects, view)[0]

    def of_each(
        self, groups: Sequence[Collection[int]], objects: Objects, view: ViewGeometry
    ) -> list[Evidence]:
        """The evidence about objects, each of which is a group of labels."""
        masks = objects.pixels
        boxes = dict(enumerate(find_objects(masks), start=1))
        foreground = masks > 0 if view.mixed is None else (masks > 0) & ~view.mixed
        places, labels = view.points[foreground], masks[foreground]
        evidence = []
        for group in groups:
            label, members, merged = min(group), sorted(group), objects
            table = np.arange(max(len(boxes), *members) + 1, dtype=masks.dtype)
            table[members] = label
            if len(members) > 1:
                merged = replace(objects, masks=table[masks])
            visible_boxes = [box for member in members if (box := boxes.get(member)) is not None]
            box = _union(visible_boxes) if visible_boxes else None
            surface = places, table[labels]
            evidence.append(self._evidence(label, box, surface, merged, view))
        return evidence

    def _evidence(
        self,
        label: int,
        box: Box | None,
        surface: tuple[Float64, Int32],
        objects: Objects,
        view: ViewGeometry,
    ) -> Evidence:
        """Of an object whose pixels lie in a box; `surface` are all points with their labels."""
        visible = (
            np.empty((0, 3)) if box is None else self._visible_points(label, box, objects, view)
        )
        visible = _subsample(visible, self.surface_points)
        hidden = _subsample(self._hidden_points(label, objects, view, visible), self.surface_points)
        points = np.concatenate([visible, hidden])
        sigmas = np.repeat([self.visible_sigma, self.hidden_sigma], [len(visible), len(hidden)])
        outside = np.empty((0, 3))
        if len(points):
            outside = self._outside_points(label, surface, objects, view, points)
        return Evidence(points, sigmas, outside, np.full(len(outside), self.outside_sigma))

    def _visible_points(
        self, label: int, box: Box, objects: Objects, view: ViewGeometry
    ) -> Float64:
        """Points of the object, but for mixed pixels and those at borders if enough remain."""
        reach = round(self.border_pixels * objects.pixels.shape[1] / WIDTH)
        box = tuple(slice(max(side.start - reach, 0), side.stop + reach) for side in box)
        masks, points = objects.pixels[box], view.points[box]
        inside: Mask = masks == label
        min_pixels = max(MIN_POINTS, MINORITY * inside.sum())
        if view.mixed is not None:
            unmixed = inside & ~view.mixed[box]
            inside = unmixed if unmixed.sum() >= min_pixels else inside
        if reach:
            neighbours = maximum_filter((masks > 0) & (masks != label), 2 * reach + 1)
            inner = inside & ~neighbours
            inside = inner if inner.sum() >= min_pixels else inside
        return points[inside]

    def _hidden_points(
        self, label: int, objects: Objects, view: ViewGeometry, visible: Float64
    ) -> Float64:
        """Points of the rough surface that are away from all that is visible of the object."""
        if objects.instances is None or objects.tsdf is None:
            return np.empty((0, 3))
        inside = objects.instances == label
        if not inside.any():
            return np.empty((0, 3))
        box = _padded_box(inside)
        inside, tsdf = inside[box], objects.tsdf[box]
        places = np.nonzero(inside & ~binary_erosion(inside))
        slope = np.stack(list(np.gradient(tsdf)), axis=-1)[places]
        slope /= np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
        points = view.grid.centres()[box][places] - tsdf[places][:, None] * slope
        if not len(visible) or not len(points):
            return np.asarray(points, dtype=np.float64)
        return points[cKDTree(visible).query(points)[0] > 2 * view.grid.voxel_size]

    def _outside_points(
        self,
        label: int,
        surface: tuple[Float64, Int32],
        objects: Objects,
        view: ViewGeometry,
        points: Float64,
    ) -> Float64:
        room = 4 * view.grid.voxel_size
        low, high = points.min(axis=0) - room, points.max(axis=0) + room
        box = _voxel_box(view.grid, low, high)
        centres, free_mask = view.grid.centres()[box], view.free[box]
        places, labels = surface
        free_places = centres[free_mask]
        free_places = free_places[_rows_in_box(free_places, low, high)]
        free_points = _subsample(free_places, self.outside_points)
        rows = _rows_in_box(places, low, high)
        neighbours = places[rows[labels[rows] != label]]
        x, y = np.meshgrid(*np.linspace(low[:2], high[:2], 10).T)
        floor_points = np.stack([x, y, np.full_like(x, -OUTLIERS * NOISE)], axis=-1).reshape(-1, 3)
        silhouette_points = np.empty((0, 3))
        if view.eye is not None and self.passing_points:
            silhouette_points = passed_places(
                objects.pixels == label, view.points, view.eye, self.passing_points
            )
        return np.concatenate(
            [
                free_points,
                _subsample(neighbours, self.outside_points),
                floor_points,
                silhouette_points,
            ]
        )


def _subsample(points: Float64, max_points: int) -> Float64:
    """At most so many, evenly spread over their order."""
    if len(points) <= max_points:
        return np.asarray(points, dtype=np.float64)
    return np.asarray(
        points[np.linspace(0, len(points) - 1, max_points).astype(int)], dtype=np.float64
    )


def _rows_in_box(points: Float64, low: Float64, high: Float64) -> NDArray[np.int64]:
    """Rows of points (N, 3) between two corners."""
    rows = np.arange(len(points))
    for axis in range(3):
        values = points[rows, axis]
        rows = rows[(values > low[axis]) & (values < high[axis])]
    return rows


def _union(boxes: Sequence[Box]) -> Box:
    """The box about all of them."""
    return tuple(
        slice(min(side.start for side in sides), max(side.stop for side in sides))
        for sides in zip(*boxes, strict=True)
    )


def _padded_box(mask: Mask) -> tuple[slice, ...]:
    """The box about what is marked, and two voxels more."""
    return tuple(slice(max(low - 2, 0), high + 3) for low, high in _bounds(mask))


def _bounds(mask: Mask) -> list[tuple[int, int]]:
    """First and last index of what is marked, along each axis."""
    axes = range(mask.ndim)
    along = [np.flatnonzero(mask.any(axis=tuple(set(axes) - {k}))) for k in axes]
    return [(int(places[0]), int(places[-1])) for places in along]


def _voxel_box(grid: GridSpec, low: Float64, high: Float64) -> tuple[slice, ...]:
    """Voxels whose centres may lie between two corners (m)."""
    first = np.clip(np.floor(grid.to_voxels(low)).astype(int), 0, grid.resolution)
    last = np.clip(np.ceil(grid.to_voxels(high)).astype(int) + 1, 0, grid.resolution)
    return tuple(slice(a, b) for a, b in zip(first, last, strict=True))
