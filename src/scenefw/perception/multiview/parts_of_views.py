"""Objects found in each view alone, and which of them are the same: learns nothing."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from scipy.ndimage import binary_erosion, distance_transform_edt
from scipy.spatial import cKDTree

from scenefw.core.batches import Completion, PartialTSDF
from scenefw.core.errors import InputError
from scenefw.mapping.several_views import require_agreement, stacked
from scenefw.perception.evidence.gathering import View, seen_free
from scenefw.perception.grouping.hulls import hull_distance, thinned
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.view_frames import seen_frames

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.protocols import Reconstructor
    from scenefw.core.types import Float32, Float64, GridSpec, Int32
    from scenefw.perception.grouping.relabelling import Grouping
    from scenefw.perception.multiview.same_surface import SameSurface

_REMEMBERED = 8  # views: a seventh one often comes with the six before it
_COARSE = 320  # pixels: width of the images that say which parts are one object


class PartsOfViews:
    """Joins the objects that another method finds in each view if they are one in all views.

    What one view shows of an object may be cut or joined wrongly, so all views decide together:
    `grouping` gets the objects of all as parts of one image, with the free space of all. The hull
    of all that is seen of an object is its volume, without what any view saw free.

    Args:
        inner: finds objects in one view, and says which pixels show them.
        grouping: says which objects of all views are one.
        overlap: joins what shows the same surface before that; None: only the grouping joins.
    """

    def __init__(
        self, inner: Reconstructor, grouping: Grouping, overlap: SameSurface | None = None
    ) -> None:
        self.inner, self.grouping, self.grid = inner, grouping, inner.grid
        self.overlap = overlap
        self._of_thread = threading.local()

    def __reduce__(self) -> tuple[type[PartsOfViews], tuple[Any, ...]]:
        return PartsOfViews, (self.inner, self.grouping, self.overlap)

    def complete(
        self,
        views: Sequence[PartialTSDF],
        grid: GridSpec,
        samples: int,
        generator: torch.Generator,
    ) -> list[Completion]:
        """`samples` times the same scene, with masks (1, V H, W) of all views.

        Raises:
            InputError: no view, views that contradict each other, or a method without masks.
        """
        require_agreement(views, grid)
        alone = [self._alone(view, grid, generator) for view in views]
        parts = _numbered(alone)
        frames = seen_frames(stacked(views), "joining")
        points = np.concatenate([world_points(frame) for frame in frames])
        free = np.any(seen_free(stacked(views), grid), axis=0)
        masks = parts if len(views) == 1 else self._joined(parts, points, len(views), free, grid)
        tsdf, instances = hulls(masks, points, free, grid)
        device = views[0].distance.device
        scene = Completion(
            torch.from_numpy(tsdf)[None].to(device),
            torch.from_numpy(instances)[None].to(device),
            masks=torch.from_numpy(masks)[None].to(device),
        )
        return [scene] * samples

    def _joined(
        self, parts: Int32, points: Float64, views: int, free: NDArray[np.bool_], grid: GridSpec
    ) -> Int32:
        """Objects (V H, W) of parts (V H, W) with their points (V H, W, 3)."""
        step = max(1, parts.shape[1] // _COARSE)
        if self.overlap is not None:
            images = np.split(parts, views)
            places = np.split(points, views)
            table = self.overlap.joined(
                [image[::step, ::step] for image in images],
                [place[::step, ::step] for place in places],
            )
            parts = table[parts].astype(np.int32)
        few = parts[::step, ::step]
        nothing = np.zeros(grid.shape, np.int32)
        view = View(
            points[::step, ::step],
            np.zeros_like(few),
            nothing.astype(np.float32),
            nothing,
            free,
            grid,
        )
        objects = self.grouping.objects(few, view, np.zeros(few.shape, np.float32))
        return _refined(objects, few, parts, step)

    def _alone(self, view: PartialTSDF, grid: GridSpec, generator: torch.Generator) -> Int32:
        """Masks (H, W) of one view, made once for all sets it is in."""
        last: list[tuple[PartialTSDF, GridSpec, Int32]]
        last = self._of_thread.__dict__.setdefault("last", [])
        for one, its_grid, result in last:
            if one is view and its_grid == grid:
                return result
        scene = self.inner.complete(view, grid, 1, generator)[0]
        if scene.masks is None:
            raise InputError("the method of single views doesn't say which pixels show its objects")
        result = scene.masks[0].cpu().numpy()
        last[:] = [*last, (view, grid, result)][-_REMEMBERED:]
        return result


def _numbered(alone: Sequence[Int32]) -> Int32:
    """Parts (V H, W) of all views, from 1 on."""
    images, number = [], 0
    for shown in alone:
        image = np.zeros_like(shown)
        for label in np.unique(shown[shown > 0]).tolist():
            number += 1
            image[shown == label] = number
        images.append(image)
    return np.concatenate(images)


def _refined(objects: Int32, few: Int32, parts: Int32, step: int) -> Int32:
    """Objects (V H, W) at all pixels of parts, from those at each `step`-th pixel.

    A part that was cut is dealt out to the nearest of these pixels that is of the part.
    """
    found, unused = np.zeros_like(parts), int(objects.max(initial=0)) + 1
    for part in range(1, int(parts.max(initial=0)) + 1):
        own, here = parts == part, few == part
        labels = np.unique(objects[here & (objects > 0)])
        if not len(labels):
            found[own], unused = unused, unused + 1
            continue
        found[own] = labels[0]
        if len(labels) > 1:
            rows, columns = (np.flatnonzero(own.any(axis=k)) for k in (1, 0))
            box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            at = np.zeros(parts.shape, np.int32)
            at[::step, ::step] = np.where(here, objects, 0)
            at = at[box]
            nearest = distance_transform_edt(at == 0, return_distances=False, return_indices=True)
            found[box] = np.where(own[box], at[tuple(nearest)], found[box])
    return found


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
    centres, surely = grid.centres(), binary_erosion(free, np.ones((3, 3, 3)))
    for label in np.unique(masks[masks > 0]).tolist():
        seen = thinned(points[masks == label])
        filled = hull_distance(seen, centres, grid)
        if filled is None:
            continue
        box, values = filled
        values = np.where(surely[box], np.maximum(values, grid.voxel_size / 2), values)
        tsdf[box] = np.minimum(tsdf[box], values)
        inside = values < 0
        apart = np.full(values.shape, np.inf, np.float32)
        apart[inside] = cKDTree(seen).query(centres[box][inside])[0]
        owner[box][apart < nearest[box]] = label
        nearest[box] = np.minimum(nearest[box], apart)
    return tsdf, owner
