"""Objects found in each view alone, and which of them are the same: learns nothing."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt

from scenefw.core.batches import Completion, PartialTSDF
from scenefw.core.errors import InputError
from scenefw.mapping.several_views import require_agreement, stacked
from scenefw.perception.evidence import View, seen_free
from scenefw.perception.points import world_points
from scenefw.perception.seen_frames import seen_frames

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import Reconstructor
    from scenefw.core.types import GridSpec, Int32
    from scenefw.perception.part_guided import Grouping

_REMEMBERED = 8  # views: a seventh one often comes with the six before it
_COARSE = 320  # pixels: width of the images that say which parts are one object


class PartsOfViews:
    """Joins the objects that another method finds in each view if they are one in all views.

    What one view shows of an object may be cut or joined wrongly, so all views decide together:
    `grouping` gets the objects of all as parts of one image, with the free space of all. The view
    that shows most of an object gives its volume.

    Args:
        inner: finds objects in one view, and says which pixels show them.
        grouping: says which objects of all views are one.
    """

    def __init__(self, inner: Reconstructor, grouping: Grouping) -> None:
        self.inner, self.grouping, self.grid = inner, grouping, inner.grid
        self._of_thread = threading.local()

    def __reduce__(self) -> tuple[type[PartsOfViews], tuple[Reconstructor, Grouping]]:
        return PartsOfViews, (self.inner, self.grouping)

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
        parts, volumes = _numbered(alone)
        masks = parts if len(views) == 1 else self._joined(parts, views, grid)
        instances = _instances(masks, parts, volumes, grid)
        tsdf = _distances(instances, grid)
        device = views[0].distance.device
        scene = Completion(
            torch.from_numpy(tsdf)[None].to(device),
            torch.from_numpy(instances)[None].to(device),
            masks=torch.from_numpy(masks)[None].to(device),
        )
        return [scene] * samples

    def _joined(self, parts: Int32, views: Sequence[PartialTSDF], grid: GridSpec) -> Int32:
        """Objects (V H, W) of parts (V H, W)."""
        everything = stacked(views)
        points = np.concatenate([world_points(f) for f in seen_frames(everything, "joining")])
        free = np.any(seen_free(everything, grid), axis=0)
        step = max(1, parts.shape[1] // _COARSE)
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

    def _alone(
        self, view: PartialTSDF, grid: GridSpec, generator: torch.Generator
    ) -> tuple[Int32, Int32]:
        """Instances (X, Y, Z) and masks (H, W) of one view, made once for all sets it is in."""
        last: list[tuple[PartialTSDF, GridSpec, tuple[Int32, Int32]]]
        last = self._of_thread.__dict__.setdefault("last", [])
        for one, its_grid, result in last:
            if one is view and its_grid == grid:
                return result
        scene = self.inner.complete(view, grid, 1, generator)[0]
        if scene.masks is None:
            raise InputError("the method of single views doesn't say which pixels show its objects")
        result = (scene.instances[0].cpu().numpy(), scene.masks[0].cpu().numpy())
        last[:] = [*last, (view, grid, result)][-_REMEMBERED:]
        return result


def _numbered(alone: Sequence[tuple[Int32, Int32]]) -> tuple[Int32, dict[int, Int32]]:
    """Parts (V H, W) of all views, from 1 on, and the volume (X, Y, Z) of each."""
    images, volumes = [], {}
    number = 0
    for instances, shown in alone:
        image = np.zeros_like(shown)
        for label in np.unique(shown[shown > 0]).tolist():
            number += 1
            image[shown == label] = number
            volumes[number] = instances == label
        images.append(image)
    return np.concatenate(images), volumes


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


def _instances(masks: Int32, parts: Int32, volumes: dict[int, Int32], grid: GridSpec) -> Int32:
    """Volumes (X, Y, Z) of objects, those that are seen most on top.

    Each part gives its volume to one object at most, the one that has most of its pixels.
    """
    pixels = np.zeros((int(masks.max(initial=0)) + 1, int(parts.max(initial=0)) + 1), np.int64)
    np.add.at(pixels, (masks[parts > 0], parts[parts > 0]), 1)
    best = np.where(pixels == pixels.max(axis=0), pixels, 0)
    instances = np.zeros(grid.shape, np.int32)
    for label in np.argsort(best.max(axis=1)).tolist():
        if label and best[label].any():
            instances[volumes[int(best[label].argmax())]] = label
    return instances


def _distances(instances: Int32, grid: GridSpec) -> np.ndarray:
    """TSDF (X, Y, Z) of instances."""
    if not instances.any():
        return np.full(grid.shape, grid.truncation, np.float32)
    away = distance_transform_edt(instances == 0) - distance_transform_edt(instances > 0)
    away -= 0.5 * np.sign(away)  # the surface lies between voxel centres
    return np.clip(away * grid.voxel_size, -grid.truncation, grid.truncation).astype(np.float32)
