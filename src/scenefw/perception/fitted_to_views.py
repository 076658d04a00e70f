"""Superquadrics that explain several views at once (thesis eqs 5.8 to 5.12, 5.3)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.fitting.placed import shape_of
from scenefw.mapping.several_views import require_agreement, stacked
from scenefw.perception.evidence import View, seen_free
from scenefw.perception.fitted import Fitted, with_superquadrics
from scenefw.perception.points import world_points
from scenefw.perception.seen_frames import seen_frames
from scenefw.perception.seen_instances import seen_instances

if TYPE_CHECKING:
    from collections.abc import Sequence

    import torch

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.protocols import SeveralViewsReconstructor
    from scenefw.core.types import GridSpec

_CORNERS = 6  # of meshes that say how high an object is


class FittedToViews:
    """Replaces objects by superquadrics fitted to the seen points and free space of all views.

    An object that no superquadric explains in all views keeps its volume. What is mostly
    below the floor, or ends hardly above it, is noise of the floor and goes.

    Args:
        inner: makes the scenes; if these have masks, they are of all views, one below the other.
        fitted: how one view is fitted; all views are given to it as if they were one image.
    """

    def __init__(self, inner: SeveralViewsReconstructor, fitted: Fitted) -> None:
        self.inner, self.fitted, self.grid = inner, fitted, inner.grid

    def complete(
        self,
        views: Sequence[PartialTSDF],
        grid: GridSpec,
        samples: int,
        generator: torch.Generator,
    ) -> list[Completion]:
        """Complete scenes of sharp objects, the best fit of each scene of the inner method.

        Raises:
            InputError: no view, views that contradict each other, or that came without images.
        """
        require_agreement(views, grid)
        everything = stacked(views)
        points = np.concatenate([world_points(f) for f in seen_frames(everything, "a fit")])
        free = np.any(seen_free(everything, grid), axis=0)
        scenes = self.inner.complete(views, grid, samples, generator)
        once = {id(scene): scene for scene in scenes}
        sharp = {key: self._sharp(one, points, free, grid) for key, one in once.items()}
        return [sharp[id(scene)] for scene in scenes]

    def _sharp(
        self, scene: Completion, points: np.ndarray, free: np.ndarray, grid: GridSpec
    ) -> Completion:
        tsdf, instances = scene.tsdf[0].cpu().numpy(), scene.instances[0].cpu().numpy()
        if scene.masks is None:
            masks = seen_instances(instances, points, grid, points[..., 2] > 0)
        else:
            masks = scene.masks[0].cpu().numpy()
        view = View(points, masks, tsdf, instances, free, grid)
        (found,) = self.fitted.superquadrics(view)
        sunk = [label for label, one in found.items() if _sunk(one, self.fitted.lowest)]
        kept = replace(view, instances=np.where(np.isin(instances, sunk), 0, instances))
        above = {label: one for label, one in found.items() if label not in sunk}
        return with_superquadrics(replace(scene, masks=None), [(kept, above)])


def _sunk(one: FittedSuperquadric, lowest: float) -> bool:
    """Whether more of it is below the floor than above, or it ends lower than this (m)."""
    heights = shape_of(one).mesh(_CORNERS).vertices @ one.pose.rotation[2]
    return bool(one.pose.position[2] < 0 or heights.max() + one.pose.position[2] < lowest)
