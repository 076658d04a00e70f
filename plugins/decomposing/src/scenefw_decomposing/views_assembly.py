"""From objects of several views to a scene: volumes, meshes, and how well it explains the views."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.perception.estimate.assembly import cleaned, scene_estimate
from scenefw.perception.estimate.composition import composed
from scenefw.perception.estimate.exclusive_space import exclusive
from scenefw.perception.observation.components import EDGE
from scenefw.perception.observation.pixels import coarse_step
from scenefw.perception.observation.surface_mesh import obstacles_of
from scenefw_decomposing.nearest_objects import explained_shares

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from scenefw.core.batches import Completion
    from scenefw.core.types import Float64, SceneEstimate
    from scenefw.perception.evidence.tolerances import Tolerances
    from scenefw.perception.observation.views import Views
    from scenefw.perception.steps import ObjectSet
    from scenefw.postprocessing.confidence import ExpectedOverlap


class ViewsAssembly:
    """Makes the scene of objects that several views show; its confidence needs no hypotheses.

    It is the share of visible points that lie on an object, of those that are nearest to it. The
    surer of two objects keeps what both fill.

    Args:
        tolerances: say which points lie on an object.
    """

    calibration: ExpectedOverlap | None = None

    def __init__(self, tolerances: Tolerances) -> None:
        self.tolerances = tolerances

    def volumes(self, sets: Sequence[ObjectSet], view: Views) -> list[Completion]:
        """TSDF and instances of each hypothesis as it is, once of one that stands several times.

        Masks of several images are left out.
        """
        different = {id(hypothesis): hypothesis for hypothesis in sets}
        scenes = {k: replace(composed(item, view), masks=None) for k, item in different.items()}
        return [scenes[id(hypothesis)] for hypothesis in sets]

    def assemble(
        self, sets: Sequence[ObjectSet], view: Views, origin: Mapping[str, Any]
    ) -> Iterator[SceneEstimate]:
        """The scene of each hypothesis.

        Args:
            sets: hypotheses.
            view: that show the scene.
            origin: facts of the method, for the details.
        """
        inlier_distance = self.tolerances.inlier_distance
        points = _visible_points(view)
        obstacles = obstacles_of(view.observations)
        details = {
            **origin,
            "confidence": f"share of seen points within {inlier_distance * 1000:g} mm of the "
            "surface",
            "views": [observation.frame.name for observation in view.observations],
            "table": view.table,
            "warnings": list(view.warnings),
        }
        for scene in self.volumes(sets, view):
            whole = cleaned(scene, view.grid, view.partial)
            estimate = scene_estimate(whole, view.grid, view.frame, {}, details)
            shares = explained_shares(points, estimate.objects, inlier_distance, EDGE)
            objects = tuple(replace(item, confidence=shares[item.id]) for item in estimate.objects)
            yield replace(estimate, objects=exclusive(objects), obstacles=obstacles)


def _visible_points(view: Views) -> Float64:
    """Some of the points (N, 3) of objects in all views (m)."""
    step = coarse_step(view.frame.depth.shape[1])
    thinned = np.s_[::step, ::step]
    return np.concatenate(
        [
            observation.points[thinned][observation.workspace.objects[thinned]]
            for observation in view.observations
            if observation.workspace is not None
        ]
    )
