"""The strongest reference that learns nothing: parts of a depth image, filled as convex hulls."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.spatial import ConvexHull, QhullError, cKDTree

from scenefw.perception.estimate.carving import carve
from scenefw.perception.observation.object_masks import footprint_hulls
from scenefw.perception.observation.points import SAMPLE, points_by_label
from scenefw.perception.steps import Objects

if TYPE_CHECKING:
    from scenefw.core.types import Float32, Float64, GridSpec, Int32
    from scenefw.perception.observation.observation import Observation, ViewGeometry
    from scenefw.perception.steps import Segmentation


class HullFilling:
    """Fills the convex hull of each segment of a depth image down to the floor (group `grouping`).

    A hull is that of a segment's points and of their footprints on the floor z = 0. Where hulls
    overlap, the segment whose visible points are nearest has the voxel. What the view shows to be
    free is taken away again. Where no shape explains an object, its surface is the hull itself,
    not that of the voxels. It learns nothing.

    Args:
        segmentation: whose segments are filled instead; None: those that are given.
    """

    grid: GridSpec | None = None

    def __init__(self, segmentation: Segmentation | None = None) -> None:
        self.segmentation = segmentation

    def group(self, segments: Int32 | None, view: Observation) -> Objects:
        """Each segment as an object, with its hull.

        Args:
            segments: (H, W), 0 = none; numbers may have gaps.
            view: of their image.
        """
        if self.segmentation is not None:
            segments = self.segmentation.segment(view)
        segments = Objects(segments).pixels
        tsdf, owner = hulls(segments, view)
        carved = carve(torch.from_numpy(tsdf), view.partial, view.grid).numpy()
        instances = np.where(carved < 0, owner, 0).astype(np.int32)
        return Objects(segments, carved, instances, meshes=footprint_hulls(segments, view.points))


def hulls(segments: Int32, view: ViewGeometry) -> tuple[Float32, Int32]:
    """Distances (X, Y, Z; m) to hulls, and the segment (X, Y, Z) whose hull a voxel may lie in."""
    grid, centres = view.grid, view.grid.centres()
    distance = np.full(grid.shape, grid.truncation, np.float32)
    owner = np.zeros(grid.shape, np.int32)
    nearest = np.full(grid.shape, np.inf, np.float32)
    for label, segment_points in points_by_label(segments, view.points).items():
        points = thinned(segment_points)
        hull = hull_distance(points, centres, grid)
        if hull is None:
            continue
        box, values = hull
        distance[box] = np.minimum(distance[box], values)
        inside = values < 0
        to_points = np.full(values.shape, np.inf, np.float32)
        to_points[inside] = cKDTree(points).query(centres[box][inside])[0]
        closer = to_points < nearest[box]
        owner[box][closer] = label
        nearest[box] = np.minimum(nearest[box], to_points)
    return distance, owner


def thinned(points: Float64) -> Float64:
    """At most so many points, spread evenly over the image."""
    return points[:: -(-len(points) // SAMPLE)]


def hull_distance(
    visible_points: Float64, centres: Float64, grid: GridSpec
) -> tuple[tuple[slice, ...], Float32] | None:
    """The box around a part's hull and distances (m) there; None if the hull has no volume.

    Outside and beside edges the distance is that to the farthest plane, a lower bound.
    """
    points = np.concatenate([visible_points, visible_points * (1, 1, 0)])
    try:
        planes = np.unique(ConvexHull(points).equations, axis=0)  # of triangles, many share one
    except QhullError:  # all points in one plane
        return None
    reach = grid.truncation
    low = np.floor(grid.to_voxels(points.min(axis=0) - reach)).astype(int)
    high = np.ceil(grid.to_voxels(points.max(axis=0) + reach)).astype(int) + 1
    ends = np.clip([low, high], 0, grid.resolution)
    box = tuple(slice(a, b) for a, b in ends.T)
    places = centres[box]
    if not places.size:
        return None
    heights = _farthest_heights(planes, places.reshape(-1, 3), reach).reshape(places.shape[:-1])
    return box, np.clip(heights, -reach, reach).astype(np.float32)


def _farthest_heights(planes: Float64, places: Float64, reach: float) -> Float64:
    """Height (P,) of each place above the plane that is farthest below it, or `reach` or more.

    Most places are soon known to be out of reach, and the further planes are left out for them.
    """
    heights, active_rows = np.full(len(places), -np.inf), np.arange(len(places))
    for plane_batch in np.array_split(planes, math.isqrt(len(planes))):
        batch_heights = plane_batch[:, :3] @ places[active_rows].T + plane_batch[:, 3:]
        heights[active_rows] = np.maximum(heights[active_rows], batch_heights.max(axis=0))
        active_rows = active_rows[heights[active_rows] < reach]
    return heights
