"""Predicted superquadrics fitted again to what a view shows of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE, above
from scenefw.fitting.placed import signed_distance
from scenefw.perception.completion.hidden_objects import possible
from scenefw.perception.evidence.pseudo_observations import add_predicted_surface

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.protocols import ShapeFit
    from scenefw.perception.evidence.gathering import EvidenceGathering
    from scenefw.perception.observation.observation import ViewGeometry
    from scenefw.perception.steps import Objects


class SetRefinement:
    """Fits predicted objects to their seen points; where nothing is seen, the prediction counts.

    Points of a predicted surface that lie away from all that is seen of its object are evidence as
    well, less certain than seen ones. An object whose fit explains less than the prediction stays
    as predicted. One of which too little is seen does so too, unless it lies where the view shows
    that nothing is, or in another object: then it is left out.

    Args:
        fit: of superquadrics to evidence.
        evidence: what a view says about an object.
        inlier_distance: seen points up to this far from the surface are explained (m).
        min_points: seen points that an object must have to be fitted.
        pseudo_sigma: standard deviation of points of predicted surfaces (m).
        min_gap: points of predicted surfaces count that are further than this from seen ones (m).

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        fit: ShapeFit,
        evidence: EvidenceGathering,
        inlier_distance: float = 0.006,
        min_points: int = 60,
        pseudo_sigma: float = 0.008,
        min_gap: float = 0.01,
    ) -> None:
        POSITIVE.require(inlier_distance=inlier_distance)
        COUNT.require(min_points=min_points)
        NOT_NEGATIVE.require(min_gap=min_gap)
        above(evidence.visible_sigma, "as what is seen is the more certain").require(
            pseudo_sigma=pseudo_sigma
        )
        self.fit, self.evidence, self.inlier_distance, self.min_points = (
            fit,
            evidence,
            inlier_distance,
            min_points,
        )
        self.pseudo_sigma, self.min_gap = pseudo_sigma, min_gap

    def refined(
        self, predicted: Mapping[int, FittedSuperquadric], objects: Objects, view: ViewGeometry
    ) -> dict[int, FittedSuperquadric]:
        """Objects by label, as seen points and predictions say together.

        Args:
            predicted: superquadrics.
            objects: which pixels show them.
            view: of their image.
        """
        evidence = {label: self.evidence.of(label, objects, view) for label in predicted}
        fit_evidence = {
            k: item
            for k, item in evidence.items()
            if self._visible_mask(item).sum() >= self.min_points
        }
        start = [predicted[label] for label in fit_evidence]
        extended_evidence = [
            self._extended_evidence(*pair)
            for pair in zip(fit_evidence.values(), start, strict=True)
        ]
        fitted = self.fit.together(extended_evidence, start) if start else []
        shapes = {
            label: self._better_fit(shape, predicted[label], fit_evidence[label])
            for label, shape in zip(fit_evidence, fitted, strict=True)
        }
        for label, shape in predicted.items():
            if label not in fit_evidence and possible([shape], view, list(shapes.values())):
                shapes[label] = shape
        return shapes

    def _better_fit(
        self, fitted: FittedSuperquadric, predicted: FittedSuperquadric, evidence: Evidence
    ) -> FittedSuperquadric:
        candidates = [
            replace(shape, distances=signed_distance(shape, evidence.points))
            for shape in (fitted, predicted)
        ]
        inlier_ratios = [self._inlier_ratio(shape, evidence) for shape in candidates]
        return candidates[0] if inlier_ratios[0] >= inlier_ratios[1] else candidates[1]

    def _inlier_ratio(self, shape: FittedSuperquadric, evidence: Evidence) -> float:
        return float(
            (np.abs(shape.distances[self._visible_mask(evidence)]) < self.inlier_distance).mean()
        )

    def _visible_mask(self, evidence: Evidence) -> np.ndarray:
        return np.asarray(evidence.sigmas == self.evidence.visible_sigma)

    def _extended_evidence(self, evidence: Evidence, predicted: FittedSuperquadric) -> Evidence:
        return add_predicted_surface(evidence, predicted, self.pseudo_sigma, self.min_gap)
