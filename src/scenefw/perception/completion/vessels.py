"""Objects of a view that are vessels: into which it sees."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.ndimage import binary_erosion

from scenefw.core.lazy_mapping import LazyMapping
from scenefw.core.settings import NOT_NEGATIVE, SHARE, at_least
from scenefw.fitting.placed import signed_distance
from scenefw.perception.evidence.silhouettes import box_about
from scenefw.perception.observation.pixels import WIDTH
from scenefw.perception.observation.points import MAJORITY, MINORITY, STRAYS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Float64, GridSpec, Int32
    from scenefw.fitting.vessels import FittedVessel
    from scenefw.perception.evidence.tolerances import Tolerances
    from scenefw.perception.observation.observation import ViewGeometry
    from scenefw.perception.observation.views import View
    from scenefw.perception.steps import ObjectSet

    Mask = NDArray[np.bool_]


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
        edge_pixels: pixels (of an image 640 wide) at the ends of an object that don't count.
        min_gain: by how much more than a superquadric.
        min_depth: by how much these lie below its rim (m).
        min_width_ratio: share of its diameter over which points must lie.
        min_points: points that an object must have.

    Raises:
        ConfigError: a share outside 0..1, or another number that isn't positive.
    """

    def __init__(
        self,
        fit: FitsVessels,
        tolerances: Tolerances,
        points: int = 300,
        edge_pixels: int = 2,
        min_gain: float = 0.05,
        min_depth: float = 0.008,
        min_width_ratio: float = 0.75,
        min_points: int = 100,
    ) -> None:
        SHARE.require(
            min_gain=min_gain,
            min_width_ratio=min_width_ratio,
        )
        at_least(10).require(points=points, min_points=min_points)
        NOT_NEGATIVE.require(edge_pixels=edge_pixels, min_depth=min_depth)
        self.fit, self.tolerances, self.points, self.edge_pixels = (
            fit,
            tolerances,
            points,
            edge_pixels,
        )
        self.min_gain = min_gain
        self.min_depth, self.min_points = min_depth, min_points
        self.min_width_ratio = min_width_ratio

    def replace(self, sets: Sequence[ObjectSet], view: View) -> list[ObjectSet]:
        """Hypotheses in which objects that the view looks into are vessels, the same in all."""
        first = sets[0]
        if first.superquadrics is None:
            return list(sets)
        vessels: dict[int, FittedVessel] = {}
        masks = np.split(first.objects.pixels, len(view.cameras))
        for camera, mask in zip(view.cameras, masks, strict=True):  # the first that sees inside
            vessels = self.detect(mask, camera, first.evidence, first.superquadrics) | vessels
        return [with_vessels(hypothesis, vessels) for hypothesis in sets]

    def join(self, segments: Int32, view: ViewGeometry) -> Int32:
        """Segments (H, W), 0 = none, in which inside and outside of a vessel are one.

        Images are cut along rims, where depth jumps. A vessel has to explain both sides, most of
        one as its inside and most of the other as its outside.

        Args:
            segments: (H, W), 0 = none.
            view: of one camera.
        """
        if view.eye is None:
            return segments
        samples = {
            int(label): self._points(segments, view, label, self.points // 2)
            for label in np.unique(segments[segments > 0])
        }
        samples = {label: part for label, part in samples.items() if len(part) >= self.min_points}
        labels = np.arange(int(segments.max(initial=0)) + 1, dtype=np.int32)
        for a, b in combinations(samples, 2):
            if labels[a] != labels[b] and self._are_sides(samples[a], samples[b], view):
                labels[labels == labels[b]] = labels[a]
        return labels[segments]

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
        vessels: dict[int, FittedVessel] = {}
        if view.eye is None:  # no camera looks into anything
            return vessels
        free = view.clear  # so that no wall lies in it by half a voxel
        for label in labels:
            points = self._points(masks, view, label, self.points)
            if len(points) < self.min_points:
                continue
            superquadric = superquadrics.get(label)
            superquadric_ratio = (
                0.0 if superquadric is None else self._inlier_ratio(superquadric, points, view.eye)
            )
            min_ratio = max(self.tolerances.min_inlier_ratio, superquadric_ratio + self.min_gain)
            if min_ratio > 1:
                continue
            vessel = self.fit.fit(points, view.eye)
            if self.tolerances.inlier_ratio(vessel.distances) >= min_ratio and self._is_open(
                vessel, points, view.grid, free
            ):
                vessels[label] = vessel
        return vessels

    def _may_be_sides(self, a: Float64, b: Float64) -> bool:
        """Whether points may be of two sides of a vessel: their rims lie on one circle (Kasa 1976).

        It spares most pairs a fit.
        """
        if abs(a[:, 2].max() - b[:, 2].max()) > self.min_depth:
            return False
        points = np.concatenate([a, b])
        is_rim = points[:, 2] > points[:, 2].max() - self.min_depth
        if is_rim.mean() > MAJORITY:  # a flat top
            return False
        rim = points[is_rim, :2]
        terms = np.column_stack([2 * rim, np.ones(len(rim))])
        *centre, constant = np.linalg.lstsq(terms, (rim**2).sum(axis=1))[0]
        radius = np.sqrt(max(constant + np.square(centre).sum(), 0.0))
        distances = np.linalg.norm(rim - centre, axis=1) - radius
        width = np.ptp(points[:, :2], axis=0).max()
        if min(width, 2 * radius) < self.min_width_ratio * max(width, 2 * radius):
            return False
        return bool(self.tolerances.inlier_ratio(distances) >= self.tolerances.min_inlier_ratio)

    def _are_sides(self, a: Float64, b: Float64, view: ViewGeometry) -> bool:
        """Whether one vessel explains both parts, one as its inside, one as its outside."""
        if view.eye is None or not self._may_be_sides(a, b):
            return False
        points = np.concatenate([a, b])
        vessel = self.fit.fit(points, view.eye)
        if not self._is_open(vessel, points, view.grid, view.clear):
            return False
        parts = np.s_[: len(a)], np.s_[len(a) :]
        ratios = [self.tolerances.inlier_ratio(vessel.distances[part]) for part in parts]
        are_inside = [vessel.inside[part].mean() > MAJORITY for part in parts]
        return min(ratios) >= self.tolerances.min_inlier_ratio and are_inside[0] != are_inside[1]

    def _points(self, masks: Int32, view: ViewGeometry, label: int, count: int) -> Float64:
        """At most so many points of an object, not where its image ends: they are of nothing."""
        edge = round(self.edge_pixels * masks.shape[1] / WIDTH)
        object_mask = masks == label
        if not object_mask.any():
            return np.empty((0, 3))
        box = box_about(object_mask, edge + 1)
        inner, measured = object_mask[box], view.points[box]
        inner = binary_erosion(inner, iterations=edge) if edge else inner
        inner &= np.isfinite(measured[..., 2])
        points = measured[inner if view.mixed is None else inner & ~view.mixed[box]]
        indices = np.linspace(0, len(points) - 1, min(count, len(points))).astype(int)
        return np.asarray(points[indices], np.float64)

    def _inlier_ratio(
        self, superquadric: FittedSuperquadric, points: Float64, eye: Float64
    ) -> float:
        """Share of the points that a superquadric explains on the side that looks at the camera."""
        distances, reach = signed_distance(superquadric, points), self.tolerances.inlier_distance
        to_eye = eye - points
        probes = points + reach * to_eye / np.linalg.norm(to_eye, axis=1, keepdims=True)
        faces_eye = signed_distance(superquadric, probes) > distances
        return float(((np.abs(distances) < reach) & faces_eye).mean())

    def _is_open(self, vessel: FittedVessel, points: Float64, grid: GridSpec, free: Mask) -> bool:
        """Whether the view sees into it, and through little of its wall.

        Depth hides the rim that is nearest to the camera, so what is seen through is compared with
        the volume within the vessel's outside, not with that of its wall.
        """
        rim = vessel.pose.position[2] + vessel.shape.bottom + vessel.shape.height
        interior = vessel.inside & (points[:, 2] < rim - self.min_depth)
        visible_width = np.ptp(points[:, :2], axis=0).max()
        narrow = visible_width < self.min_width_ratio * 2 * vessel.shape.radius
        if interior.mean() < MINORITY or narrow:
            return False
        corners = vessel.shape.mesh().vertices + vessel.pose.position
        voxels, inside = grid.nearest_voxels(corners)
        free_volume = free[tuple(voxels[inside].T)].mean() * vessel.shape.volume()
        return bool(
            inside.mean() >= 1 - STRAYS and free_volume < MINORITY * vessel.shape.filled_volume()
        )


def with_vessels(hypothesis: ObjectSet, vessels: Mapping[int, FittedVessel]) -> ObjectSet:
    """The hypothesis with vessels in place of other shapes of these labels."""
    solid = hypothesis.superquadrics or {}
    solid = {label: shape for label, shape in solid.items() if label not in vessels}
    solid_labels = [label for label in hypothesis.shells if label not in vessels]
    shells = LazyMapping(solid_labels, hypothesis.shells.__getitem__)
    return replace(hypothesis, superquadrics=solid, vessels=vessels, shells=shells)
