"""A superquadric for each object of which enough is visible."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.settings import NOT_NEGATIVE
from scenefw.perception.evidence.visible_instances import visible_instances
from scenefw.perception.observation.points import MIN_POINTS, STRAYS, points_by_label
from scenefw.perception.steps import Fits

if TYPE_CHECKING:
    from scenefw.core.evidence import Evidence
    from scenefw.core.protocols import ShapeFit
    from scenefw.core.types import Float64
    from scenefw.perception.evidence.gathering import EvidenceGathering
    from scenefw.perception.observation.observation import ViewGeometry
    from scenefw.perception.steps import Objects


class ObjectFit:
    """Fits a superquadric to each object by itself (thesis eqs 5.8 to 5.12).

    It explains an object's visible points, with rough volumes as a weak hint where it is hidden,
    and contains nothing that is free, no point of another object, and nothing below the floor.
    Where a mask has no volume, it is an object if it stands in the grid and above the floor.

    Args:
        fit: of superquadrics to evidence.
        evidence: what a view says about an object.
        min_height: above the floor that an object without a volume must reach (m).

    Raises:
        ConfigError: a negative height.
    """

    def __init__(self, fit: ShapeFit, evidence: EvidenceGathering, min_height: float) -> None:
        NOT_NEGATIVE.require(min_height=min_height)
        self.shape_fit, self.evidence = fit, evidence
        self.min_height = min_height

    def fit(self, objects: Objects, view: ViewGeometry) -> Fits:
        """Superquadrics of objects, each as if there were no others.

        Args:
            objects: without masks, a pixel shows the volume that its point lies in.
            view: of their image.
        """
        if objects.masks is None and objects.instances is not None:
            above_floor = view.points[..., 2] > 0
            masks = visible_instances(objects.instances, view.points, view.grid, above_floor)
            objects = replace(objects, masks=masks)
        evidence = self.visible(objects, view)
        shapes = self.shape_fit.fit(list(evidence.values())) if evidence else []
        return Fits(objects, evidence, dict(zip(evidence, shapes, strict=True)))

    def visible(self, objects: Objects, view: ViewGeometry) -> dict[int, Evidence]:
        """Evidence about objects of which enough is visible, by label."""
        masks = objects.pixels
        volumes = np.zeros(0, np.int32) if objects.instances is None else objects.instances
        volume_labels = np.unique(volumes[volumes > 0])
        labels = np.union1d(volume_labels, masks[masks > 0]).astype(int).tolist()
        points = points_by_label(masks, view.points)
        labels = [k for k in labels if k in volume_labels or self._is_standing(points[k], view)]
        observations = self.evidence.of_each([[k] for k in labels], objects, view)
        evidence = dict(zip(labels, observations, strict=True))
        sigma = self.evidence.visible_sigma
        return {k: e for k, e in evidence.items() if (e.sigmas == sigma).sum() >= MIN_POINTS}

    def _is_standing(self, points: Float64, view: ViewGeometry) -> bool:
        """Whether what is visible of an object without a volume is in the grid and above it."""
        voxels = view.grid.to_voxels(points)
        inside = ((voxels > 0) & (voxels < view.grid.resolution - 1)).all(axis=-1)
        high = np.quantile(points[:, 2], 1 - STRAYS) > self.min_height
        return bool(inside.mean() >= 1 - STRAYS and high)
