"""Objects of a view that are vessels: into which it sees."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.ndimage import binary_erosion

from scenefw.core.settings import NOT_NEGATIVE, SHARE, at_least
from scenefw.fitting.placed import signed_distance
from scenefw.perception.observation.pixels import WIDTH

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Float64, GridSpec, Int32
    from scenefw.fitting.vessels import FittedVessel
    from scenefw.perception.evidence.tolerances import Tolerances
    from scenefw.perception.observation.observation import Observation, ViewGeometry
    from scenefw.perception.steps import ObjectSet

    Mask = NDArray[np.bool_]

_BEFORE, _WITHIN = 0.02, 0.004  # m: so far before a seen point, nothing is so deep in a solid
_THERE = 0.98  # share of a vessel in the grid
VESSEL_SECTIONS = 24  # of a surface that is looked up in volumes


class FitsVessels(Protocol):
    """A fit of a vessel to points."""

    def fit(self, points: Float64, eye: Float64) -> FittedVessel:
        """The best vessel for points (N, 3) of the world that a camera at (3,) sees (m)."""


class Vessels:
    """Says which objects of a view are vessels, by their inside.

    A vessel has to explain most of what is seen of an object, better than its superquadric does,
    and enough of that has to lie on its inside, below the rim. So nothing becomes hollow into which
    the view doesn't see. A superquadric doesn't explain what is seen through it: the far wall of a
    bowl lies on the surface of an ellipsoid, but on the side that looks away. Most of a vessel's
    width has to be seen, and it must not be flat, so that no wave of the floor becomes a plate.

    Args:
        fit: of a vessel to points.
        tolerances: say which points it explains, and how many it must.
        points: of an object, at most.
        edge: pixels (of an image 640 wide) at the ends of an object that don't count.
        better: by how much more than a superquadric.
        inside: share of the points that must lie on its inside.
        below: by how much these lie below its rim (m).
        width: share of its diameter over which points must lie.
        flattest: height that it must have (m).
        through: share of its surface that may lie where the view sees through.
        least: points that an object must have.

    Raises:
        ConfigError: a share outside 0..1, or another number that isn't positive.
    """

    def __init__(
        self,
        fit: FitsVessels,
        tolerances: Tolerances,
        points: int = 300,
        edge: int = 2,
        better: float = 0.05,
        inside: float = 0.1,
        below: float = 0.008,
        width: float = 0.75,
        flattest: float = 0.015,
        through: float = 0.15,
        least: int = 100,
    ) -> None:
        SHARE.require(better=better, inside=inside, width=width, through=through)
        at_least(10).require(points=points, least=least)
        NOT_NEGATIVE.require(edge=edge, below=below, flattest=flattest)
        self.fit, self.tolerances, self.points, self.edge = fit, tolerances, points, edge
        self.better = better
        self.inside, self.below, self.through, self.least = inside, below, through, least
        self.width, self.flattest = width, flattest

    def replace(self, sets: Sequence[ObjectSet], view: Observation) -> list[ObjectSet]:
        """Hypotheses in which objects that the view looks into are vessels, the same in all."""
        first = sets[0]
        if first.superquadrics is None:
            return list(sets)
        masks = first.objects.pixels
        vessels = self.detect(masks, view, first.evidence, first.superquadrics)
        return [with_vessels(each, vessels) for each in sets]

    def detect(
        self,
        masks: Int32,
        view: ViewGeometry,
        labels: Iterable[int],
        superquadrics: Mapping[int, FittedSuperquadric],
    ) -> dict[int, FittedVessel]:
        """The vessels among some objects of a view, by label.

        Args:
            masks: (H, W) which object a pixel shows.
            view: of one camera.
            labels: of objects that are in the grid.
            superquadrics: those that explain objects.
        """
        kept: dict[int, FittedVessel] = {}
        if view.eye is None:  # several views: seen from all around
            return kept
        free = view.clear  # so that no wall lies in it by half a voxel
        for label in labels:
            points = self._points(masks, view, label)
            if len(points) < self.least:
                continue
            known = superquadrics.get(label)
            reached = 0.0 if known is None else self._reached(known, points, view.eye)
            wanted = max(self.tolerances.min_inlier_ratio, reached + self.better)
            if wanted > 1:
                continue
            one = self.fit.fit(points, view.eye)
            if self.tolerances.inlier_ratio(one.distances) >= wanted and self._open(
                one, points, view.grid, free
            ):
                kept[label] = one
        return kept

    def _points(self, masks: Int32, view: ViewGeometry, label: int) -> Float64:
        """Points of an object, away from where its image ends: there they belong to nothing."""
        own = masks == label
        edge = round(self.edge * own.shape[1] / WIDTH)
        inner = binary_erosion(own, iterations=edge) if edge else own
        inner &= np.isfinite(view.points[..., 2])
        points = view.points[inner if view.mixed is None else inner & ~view.mixed]
        chosen = np.linspace(0, len(points) - 1, min(self.points, len(points))).astype(int)
        return np.asarray(points[chosen], np.float64)

    def _reached(self, known: FittedSuperquadric, points: Float64, eye: Float64) -> float:
        """Share of the points that a superquadric explains on the side that looks at the camera."""
        near = np.abs(signed_distance(known, points)) < self.tolerances.inlier_distance
        way = eye - points
        before = points + _BEFORE * way / np.linalg.norm(way, axis=1, keepdims=True)
        return float((near & (signed_distance(known, before) > -_WITHIN)).mean())

    def _open(self, one: FittedVessel, points: Float64, grid: GridSpec, free: Mask) -> bool:
        """Whether the view sees into it, and none of its wall where it sees through."""
        rim = one.pose.position[2] + one.shape.bottom + one.shape.height
        within = one.inside & (points[:, 2] < rim - self.below)
        seen = np.ptp(points[:, :2], axis=0).max()
        narrow = seen < self.width * 2 * one.shape.radius
        if within.mean() < self.inside or narrow or one.shape.height < self.flattest:
            return False
        corners = one.shape.mesh(VESSEL_SECTIONS).vertices + one.pose.position
        voxels, there = grid.nearest_voxels(corners)
        through = free[tuple(voxels[there].T)]
        return bool(there.mean() > _THERE and through.mean() < self.through)


def with_vessels(hypothesis: ObjectSet, vessels: Mapping[int, FittedVessel]) -> ObjectSet:
    """The hypothesis with vessels in place of the superquadrics of these labels."""
    solid = hypothesis.superquadrics or {}
    solid = {label: shape for label, shape in solid.items() if label not in vessels}
    return replace(hypothesis, superquadrics=solid, vessels=vessels)
