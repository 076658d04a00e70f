"""Parts of an image joined to objects where one superquadric explains several of them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from scenefw.core.settings import POSITIVE, at_least
from scenefw.fitting.placed import OUTLIERS, signed_distance
from scenefw.perception.observation.floor import TABLE_HEIGHT
from scenefw.perception.observation.points import DRAWS, points_by_label
from scenefw.perception.segmentation.regions import hiding

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.types import Float32, Float64, Int32
    from scenefw.perception.grouping.segment_fits import SegmentFits
    from scenefw.perception.observation.observation import ViewGeometry

    Group = frozenset[int]

_MAX_FREE_RATIO = 0.2  # share of segments that may be seen through, at borders of voxels


class FitMerging:
    """Joins the parts that one superquadric explains as well as one for each.

    What hides the middle of an object leaves two parts of it, and one superquadric goes on behind
    what hides it. Two objects have none in common: their points are off its surface, it covers
    places that are seen to be free, or one hides the other where they meet in the image. The pair
    that is explained best is joined first.

    Args:
        fits: of superquadrics to segments.
        max_deviation: how much more squared deviation, robust, of any part's points than with a
            superquadric of its own, plus that of the places outside, is still one object.
        min_pixels: parts of fewer pixels stay alone.

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        fits: SegmentFits,
        max_deviation: float = 0.3,
        min_pixels: int = 30,
    ) -> None:
        POSITIVE.require(max_deviation=max_deviation)
        at_least(4).require(min_pixels=min_pixels)
        self.fits, self.max_deviation, self.min_pixels = fits, max_deviation, min_pixels

    def merge(self, parts: Int32, view: ViewGeometry, depth: Float32) -> Int32:
        """Objects (H, W), 0 = none, of parts (H, W) of a depth image (H, W; m)."""
        sizes = np.bincount(parts.ravel())
        large = [part for part in range(1, len(sizes)) if sizes[part] >= self.min_pixels]
        points = points_by_label(parts, view.points)
        samples = {part: _Sample.of(points[part]) for part in large}
        groups: list[Group] = [frozenset([part]) for part in large]
        hide = hiding(parts, depth)
        pairs = [
            (a, b) for a, b in combinations(groups, 2) if _may_be_one(a | b, samples, view, hide)
        ]
        single = self._fits(groups, parts, view)
        deviations = {
            part: self._deviation(single[frozenset([part])][0], points[part]) for part in large
        }
        costs = self._costs([a | b for a, b in pairs], parts, points, view, deviations)
        while costs:
            union = min(costs, key=costs.__getitem__)
            if costs[union] > self.max_deviation:
                break
            groups = [group for group in groups if not group <= union]
            costs = {pair: cost for pair, cost in costs.items() if not pair & union}
            candidates = [
                union | group for group in groups if _may_be_one(union | group, samples, view, hide)
            ]
            costs |= self._costs(candidates, parts, points, view, deviations)
            groups.append(union)
        return _relabel(parts, groups)

    def _fits(
        self, groups: Iterable[Group], parts: Int32, view: ViewGeometry
    ) -> dict[Group, tuple[FittedSuperquadric, Evidence]]:
        """One superquadric for each group, and what it is fitted to."""
        group_list = list(groups)
        return dict(zip(group_list, self.fits.of_groups(group_list, parts, view), strict=True))

    def _costs(
        self,
        groups: Iterable[Group],
        parts: Int32,
        points: dict[int, Float64],
        view: ViewGeometry,
        deviations: dict[int, float],
    ) -> dict[Group, float]:
        """How much worse one superquadric explains each group than one for each part."""
        costs = {}
        for group, (fitted, evidence) in self._fits(groups, parts, view).items():
            increases = [self._deviation(fitted, points[part]) - deviations[part] for part in group]
            costs[group] = max(*increases, 0.0) + _penetration(fitted, evidence)
        return costs

    def _deviation(self, fitted: FittedSuperquadric, points: Float64) -> float:
        """Squared deviation of a part's points from a superquadric."""
        sample = points[:: -(-len(points) // DRAWS)]
        return float(self.fits.deviations(fitted, sample).mean())


def _penetration(fitted: FittedSuperquadric, evidence: Evidence) -> float:
    """Squared depth of the places outside that it contains, per point of its surface."""
    depth = np.minimum(signed_distance(fitted, evidence.outside), 0) / evidence.outside_sigmas
    return float(np.minimum(depth**2, OUTLIERS**2).sum() / len(evidence.points))


@dataclass(frozen=True, eq=False)
class _Sample:
    """Points (N, 3) of a part, further ones, and a tree of these."""

    points: Float64
    other_points: Float64
    tree: cKDTree

    @classmethod
    def of(cls, points: Float64) -> _Sample:
        rows = np.random.default_rng(0).integers(len(points), size=(2, DRAWS))
        first, second = points[rows]
        return cls(first, second, cKDTree(second))


def _may_be_one(
    group: Group, samples: Mapping[int, _Sample], view: ViewGeometry, hide: NDArray[np.bool_]
) -> bool:
    """Whether segments between parts, which a convex object contains, miss what is free.

    And whether none hides another (P + 1, P + 1), or lies so far away that a long shape through
    both would say more about the gap between them than about what is seen.
    """
    for a, b in combinations(group, 2):
        if hide[a, b]:
            return False
        first, second = samples[a].points, samples[b].other_points
        if samples[b].tree.query(first)[0].min() > TABLE_HEIGHT:
            return False
        share = np.linspace(0.2, 0.8, 4)[:, None, None]
        voxels, inside = view.grid.nearest_voxels(first + share * (second - first))
        x, y, z = np.moveaxis(np.clip(voxels, 0, view.grid.resolution - 1), -1, 0)
        crosses_free = (view.free[x, y, z] & inside).any(axis=0)
        if crosses_free.mean() > _MAX_FREE_RATIO:
            return False
    return True


def _relabel(parts: Int32, groups: list[Group]) -> Int32:
    """Parts (H, W) with one number per group; those of no group keep one of their own."""
    numbers = np.arange(int(parts.max(initial=0)) + 1)
    for group in groups:
        numbers[list(group)] = min(group)
    return np.searchsorted(np.unique(numbers), numbers)[parts].astype(np.int32)
