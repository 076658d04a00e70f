"""Objects found in each view alone, and which of them are the same: learns nothing."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt
from scipy.optimize import linear_sum_assignment

from scenefw.core.batches import Completion, PartialTSDF
from scenefw.core.errors import ConfigError, InputError
from scenefw.mapping.several_views import require_agreement

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.protocols import Reconstructor
    from scenefw.core.types import GridSpec, Int32

    Mask = NDArray[np.bool_]

_REMEMBERED = 8  # views: a seventh one often comes with the six before it


class PartsOfViews:
    """Joins the objects that another method finds in each view by where they are.

    View by view, each object is the known one with which it shares most of the smaller one's
    volume, or a new one. What a view shows most of gives the object's volume.

    Args:
        inner: finds objects in one view, and says which pixels show them.
        shared: share of the smaller volume from which on two are one object.

    Raises:
        ConfigError: a share outside 0..1.
    """

    def __init__(self, inner: Reconstructor, shared: float = 0.35) -> None:
        if not 0 < shared <= 1:
            raise ConfigError(f"shared is {shared}; expected a share above 0")
        self.inner, self.shared, self.grid = inner, shared, inner.grid
        self._of_thread = threading.local()

    def __reduce__(self) -> tuple[type[PartsOfViews], tuple[Reconstructor, float]]:
        return PartsOfViews, (self.inner, self.shared)

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
        found = [self._alone(view, grid, generator) for view in views]
        known: list[tuple[int, Mask]] = []  # seen pixels and volume of each object
        masks = []
        for instances, shown in found:
            ids = _join(instances, shown, known, self.shared)
            table = np.zeros(int(max(shown.max(initial=0), instances.max(initial=0))) + 1, np.int32)
            table[list(ids)] = list(ids.values())
            masks.append(table[shown])
        return [_scene(known, np.concatenate(masks), grid, views[0])] * samples

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
            raise InputError("the method of single views says not which pixels show its objects")
        result = (scene.instances[0].cpu().numpy(), scene.masks[0].cpu().numpy())
        last[:] = [*last, (view, grid, result)][-_REMEMBERED:]
        return result


def _join(
    instances: Int32, shown: Int32, known: list[tuple[int, Mask]], shared: float
) -> dict[int, int]:
    """The object, from 1 on, of each label of a view; `known` is brought up to date."""
    labels = [k for k in np.unique(instances[instances > 0]).tolist() if (shown == k).any()]
    volumes = [instances == label for label in labels]
    shares = np.array([[_share(a, b) for _, b in known] for a in volumes])
    shares = shares.reshape(len(labels), len(known))
    pairs = dict(zip(*linear_sum_assignment(-shares), strict=True)) if shares.size else {}
    ids = {}
    for row, (label, volume) in enumerate(zip(labels, volumes, strict=True)):
        pixels, place = int((shown == label).sum()), pairs.get(row)
        if place is None or shares[row, place] < shared:
            known.append((pixels, volume))
            place = len(known) - 1
        elif pixels > known[place][0]:
            known[place] = (pixels, volume)
        ids[label] = int(place) + 1
    return ids


def _share(a: Mask, b: Mask) -> float:
    return float((a & b).sum() / max(1, min(a.sum(), b.sum())))


def _scene(
    known: Sequence[tuple[int, Mask]], masks: Int32, grid: GridSpec, like: PartialTSDF
) -> Completion:
    """The objects' volumes, those that are seen most on top."""
    instances = np.zeros(grid.shape, np.int32)
    for place in sorted(range(len(known)), key=lambda k: known[k][0]):
        instances[known[place][1]] = place + 1
    tsdf = np.full(grid.shape, grid.truncation, np.float32)
    if instances.any():
        away = distance_transform_edt(instances == 0) - distance_transform_edt(instances > 0)
        away -= 0.5 * np.sign(away)  # the surface lies between voxel centres
        tsdf = np.clip(away * grid.voxel_size, -grid.truncation, grid.truncation)
    device = like.distance.device
    return Completion(
        torch.from_numpy(tsdf.astype(np.float32))[None].to(device),
        torch.from_numpy(instances)[None].to(device),
        masks=torch.from_numpy(masks)[None].to(device),
    )
