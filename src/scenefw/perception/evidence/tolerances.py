"""When an object counts as explained, and when it contradicts a view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.settings import NOT_NEGATIVE, POSITIVE, SHARE
from scenefw.perception.observation.free_space import free_ratio, places_in

if TYPE_CHECKING:
    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.types import Float64
    from scenefw.perception.observation.observation import ViewGeometry


@dataclass(frozen=True)
class Tolerances:
    """How well a shape must agree with a view.

    Args:
        point_sigma: standard deviation of measured points from a surface (m).
        outside_sigma: how deep a place outside may lie in an object (m).
        floor_margin: points up to this height above the floor may be the floor's (m).
        min_pixels: of an image 640 wide, that a segment must have.
        inlier_distance: visible points up to this far from a surface lie on it (m).
        min_inlier_ratio: of an object's visible points that its shape must explain.
        max_free_ratio: of a shape that may lie where the view shows free space.

    Raises:
        ConfigError: a ratio outside 0..1, or a distance that isn't positive.
    """

    point_sigma: float
    outside_sigma: float
    floor_margin: float
    min_pixels: float
    inlier_distance: float
    min_inlier_ratio: float
    max_free_ratio: float

    def __post_init__(self) -> None:
        POSITIVE.require(inlier_distance=self.inlier_distance, point_sigma=self.point_sigma)
        POSITIVE.require(outside_sigma=self.outside_sigma)
        NOT_NEGATIVE.require(floor_margin=self.floor_margin)
        NOT_NEGATIVE.require(min_pixels=self.min_pixels)
        SHARE.require(min_inlier_ratio=self.min_inlier_ratio, max_free_ratio=self.max_free_ratio)

    def inlier_ratio(self, distances: Float64) -> float:
        """Ratio of points, by their distances from a surface (m), that lie on it."""
        return float((np.abs(distances) < self.inlier_distance).mean())

    def accept(self, shape: FittedSuperquadric, evidence: Evidence, view: ViewGeometry) -> bool:
        """Whether a shape explains what is visible of an object, and isn't in free space.

        Args:
            shape: with its distances to all points of the evidence.
            evidence: about the object.
            view: that shows it.
        """
        if self.inlier_ratio(shape.distances[evidence.visible]) < self.min_inlier_ratio:
            return False
        return free_ratio(places_in(shape), view.clear, view.grid) <= self.max_free_ratio
