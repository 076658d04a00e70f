"""Objects that somebody has marked: none is lost in voxels, and each keeps its id."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.perception.observation.object_masks import footprint_hulls

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import SceneEstimate, TriangleMesh
    from scenefw.perception.observation.observation import Observation


def marked_solids(view: Observation) -> dict[int, TriangleMesh]:
    """The hull of what is visible of each marked object and of its footprint, by its number."""
    return {} if view.masks is None else footprint_hulls(view.masks, view.points)


def called(estimate: SceneEstimate, ids: Sequence[int]) -> SceneEstimate:
    """A scene whose objects are called as somebody has called them.

    Args:
        estimate: whose objects are numbered.
        ids: of objects 1, 2 ...; those without one get the next ids. Empty: all stay.
    """
    if not ids:
        return estimate
    numbers = [item.id for item in estimate.objects]
    further = max(max(numbers, default=0) - len(ids), 0)
    next_id = max(ids) + 1
    table = np.array([0, *ids, *range(next_id, next_id + further)], np.int32)
    objects = tuple(replace(item, id=int(table[item.id])) for item in estimate.objects)
    masks = None if estimate.masks is None else table[estimate.masks]
    return replace(estimate, objects=objects, instances=table[estimate.instances], masks=masks)
