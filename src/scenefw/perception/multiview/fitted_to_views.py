"""Superquadrics that explain several views at once (thesis eqs 5.8 to 5.12, 5.3)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.fitting.placed import shape_of
from scenefw.mapping.several_views import require_agreement, stacked
from scenefw.perception.completion.superquadrics import Fitted, with_superquadrics
from scenefw.perception.completion.support import standing
from scenefw.perception.evidence.gathering import View, seen_free
from scenefw.perception.evidence.visible_instances import seen_instances
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.view_frames import seen_frames

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import torch

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.protocols import SeveralViewsReconstructor
    from scenefw.core.types import Float64, GridSpec
    from scenefw.fitting.vessels import FittedVessel

_CORNERS = 6  # of meshes that say how high an object is
_DEEP = 0.01  # m


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
        frames = seen_frames(everything, "a fit")
        points = np.concatenate([world_points(frame) for frame in frames])
        eyes = [frame.camera.T_world_camera[:3, 3] for frame in frames]
        free = np.any(seen_free(everything, grid), axis=0)
        scenes = self.inner.complete(views, grid, samples, generator)
        once = {id(scene): scene for scene in scenes}
        sharp = {key: self._sharp(one, points, eyes, free, grid) for key, one in once.items()}
        return [sharp[id(scene)] for scene in scenes]

    def _sharp(
        self,
        scene: Completion,
        points: Float64,
        eyes: Sequence[Float64],
        free: np.ndarray,
        grid: GridSpec,
    ) -> Completion:
        tsdf, instances = scene.tsdf[0].cpu().numpy(), scene.instances[0].cpu().numpy()
        if scene.masks is None:
            masks = seen_instances(instances, points, grid, points[..., 2] > 0)
        else:
            masks = scene.masks[0].cpu().numpy()
        view = View(points, masks, tsdf, instances, free, grid)
        (fits,) = self.fitted.superquadrics(view)
        found = {label: _out_of_floor(one, view) for label, one in fits.items()}
        sunk = [label for label, one in found.items() if _sunk(one, self.fitted.lowest)]
        kept = replace(view, instances=np.where(np.isin(instances, sunk), 0, instances))
        hollow = self._hollow(kept, eyes, fits)
        solid = {k: one for k, one in found.items() if k not in sunk and k not in hollow}
        return with_superquadrics(replace(scene, masks=None), [(kept, solid)], [hollow])

    def _hollow(
        self, view: View, eyes: Sequence[Float64], found: Mapping[int, FittedSuperquadric]
    ) -> dict[int, FittedVessel]:
        """Vessels, each as the view shows it into which it is seen first."""
        hollow: dict[int, FittedVessel] = {}
        places = np.split(view.points, len(eyes))
        masks = np.split(view.masks, len(eyes))
        for eye, place, mask in zip(eyes, places, masks, strict=True):
            one = replace(view, points=place, masks=mask, eye=eye)
            hollow = self.fitted.hollow(one, found) | hollow
        return hollow


def _out_of_floor(one: FittedSuperquadric, view: View) -> FittedSuperquadric:
    """What reaches far below the floor, as a fit to a shape it isn't may, ends there instead."""
    return standing([one], view)[0] if _heights(one)[0] < -_DEEP else one


def _sunk(one: FittedSuperquadric, lowest: float) -> bool:
    """Whether more of it is below the floor than above, or it ends lower than this (m)."""
    return bool(one.pose.position[2] < 0 or _heights(one)[1] < lowest)


def _heights(one: FittedSuperquadric) -> tuple[float, float]:
    """Lowest and highest point over the floor (m)."""
    heights = shape_of(one).mesh(_CORNERS).vertices @ one.pose.rotation[2] + one.pose.position[2]
    return float(heights.min()), float(heights.max())
