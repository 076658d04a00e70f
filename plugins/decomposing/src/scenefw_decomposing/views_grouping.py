"""Which of the objects that each view shows by itself are the same."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.ndimage import binary_erosion, distance_transform_edt
from scipy.spatial import cKDTree

from scenefw.perception.grouping.hulls import hull_distance, thinned
from scenefw.perception.observation.observation import JointGeometry
from scenefw.perception.observation.pixels import coarse_step
from scenefw.perception.steps import Objects

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Float64, GridSpec, Int32
    from scenefw.perception.grouping.relabelling import Merging
    from scenefw.perception.observation.observation import ViewGeometry
    from scenefw.perception.observation.views import Views
    from scenefw_decomposing.same_surface import SurfaceOverlap


class Reassignment(Protocol):
    """Gives pixels to the objects that they lie on."""

    def reassign(self, objects: Int32, view: ViewGeometry) -> Int32:
        """Objects (H, W), 0 = none."""


class ViewsGrouping:
    """Joins the objects that each view shows if they are one in all views.

    What one view shows of an object may be cut or joined wrongly, so all views decide together: the
    objects of all are merged as parts of one image, with the free space of all. The hull of all
    that is visible of an object is its volume, without what any view saw free.

    Args:
        merge: says which objects of all views are one.
        reassign: gives pixels to the objects that they lie on, in all views.
        overlap: joins what shows the same surface before that; None: only `merge` joins.
    """

    grid: GridSpec | None = None

    def __init__(
        self, merge: Merging, reassign: Reassignment, overlap: SurfaceOverlap | None = None
    ) -> None:
        self.merge, self.reassign, self.overlap = merge, reassign, overlap

    def group(self, segments: Int32 | None, view: Views) -> Objects:
        """Objects with masks (V H, W) of all views, one below the other.

        Args:
            segments: (V H, W) objects that each view shows by itself; no number is in two views.
            view: all of them.
        """
        count = len(view.observations)
        masks = Objects(segments).pixels
        masks = masks if count == 1 else self._join_parts(masks, count, view)
        return Objects(masks, *hulls(masks, view.points, view.free, view.grid))

    def _join_parts(self, parts: Int32, views: int, joint: Views) -> Int32:
        """Objects (V H, W) of parts (V H, W)."""
        step = coarse_step(parts.shape[1])
        if self.overlap is not None:
            images = np.split(parts, views)
            places = np.split(joint.points, views)
            table = self.overlap.joined(
                [image[::step, ::step] for image in images],
                [place[::step, ::step] for place in places],
            )
            parts = table[parts].astype(np.int32)
        coarse_parts = parts[::step, ::step]
        coarse_joint = JointGeometry(joint.points[::step, ::step], joint.grid, joint.free)
        objects = self.merge.merge(
            coarse_parts, coarse_joint, np.zeros(coarse_parts.shape, np.float32)
        )
        return _refined(self.reassign.reassign(objects, coarse_joint), coarse_parts, parts, step)


def _refined(objects: Int32, coarse_parts: Int32, parts: Int32, step: int) -> Int32:
    """Objects (V H, W) at all pixels of parts, from those at each `step`-th pixel.

    A part that was cut is dealt out to the nearest of these pixels that is of the part.
    """
    masks, next_label = np.zeros_like(parts), int(objects.max(initial=0)) + 1
    for part in range(1, int(parts.max(initial=0)) + 1):
        part_mask, coarse_mask = parts == part, coarse_parts == part
        labels = np.unique(objects[coarse_mask & (objects > 0)])
        if not len(labels):
            masks[part_mask], next_label = next_label, next_label + 1
            continue
        masks[part_mask] = labels[0]
        if len(labels) > 1:
            rows, columns = (np.flatnonzero(part_mask.any(axis=k)) for k in (1, 0))
            box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            seeds = np.zeros(parts.shape, np.int32)
            seeds[::step, ::step] = np.where(coarse_mask, objects, 0)
            seeds = seeds[box]
            nearest = distance_transform_edt(
                seeds == 0, return_distances=False, return_indices=True
            )
            masks[box] = np.where(part_mask[box], seeds[tuple(nearest)], masks[box])
    return masks


def hulls(
    masks: Int32, points: Float64, free: NDArray[np.bool_], grid: GridSpec
) -> tuple[Float32, Int32]:
    """TSDF and instances (X, Y, Z) of the hulls of seen objects, without what is seen to be free.

    Beside what isn't free a hull stays as it is: walls may be thinner than a voxel.

    Args:
        masks: (V H, W) objects that pixels show, 0 = none.
        points: (V H, W, 3) of these pixels, world coordinates (m).
        free: (X, Y, Z) that any view shows to be free.
        grid: of the volumes.
    """
    tsdf = np.full(grid.shape, grid.truncation, np.float32)
    owner = np.zeros(grid.shape, np.int32)
    nearest = np.full(grid.shape, np.inf, np.float32)
    centres, clear = grid.centres(), binary_erosion(free, np.ones((3, 3, 3)))
    for label in np.unique(masks[masks > 0]).tolist():
        visible_points = thinned(points[masks == label])
        hull = hull_distance(visible_points, centres, grid)
        if hull is None:
            continue
        box, values = hull
        values = np.where(clear[box], np.maximum(values, grid.voxel_size / 2), values)
        tsdf[box] = np.minimum(tsdf[box], values)
        inside = values < 0
        distances = np.full(values.shape, np.inf, np.float32)
        distances[inside] = cKDTree(visible_points).query(centres[box][inside])[0]
        owner[box][distances < nearest[box]] = label
        nearest[box] = np.minimum(nearest[box], distances)
    return tsdf, owner
