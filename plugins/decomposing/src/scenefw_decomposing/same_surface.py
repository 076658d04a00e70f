"""Which parts of several depth images are of one object, as they show the same surface."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from scenefw.core.settings import PART, POSITIVE
from scenefw.perception.observation.points import MAJORITY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Int32

# of the share from which on parts are joined: another part of the image is met too


@dataclass(frozen=True, eq=False)
class SurfaceOverlap:
    """Joins parts of different images whose points lie on each other.

    A pair is joined if that is so for a large share of the smaller part. A part that meets several
    parts of another image shows more than one object, or the other image cut one; it is
    joined with none of these. No group gets two parts of one image.

    Args:
        inlier_distance: points up to this far from each other are of one surface (m).
        min_ratio: of a part's points that lie on the other part, from which on both are one object.

    Raises:
        ConfigError: a number is out of range.
    """

    inlier_distance: float = 0.006
    min_ratio: float = 0.4

    def __post_init__(self) -> None:
        POSITIVE.require(inlier_distance=self.inlier_distance)
        PART.require(min_ratio=self.min_ratio)

    def joined(self, parts: Sequence[Int32], points: Sequence[Float64]) -> NDArray[np.int64]:
        """A table (P + 1,) from numbers of parts to the least number of their group; 0 stays 0.

        Args:
            parts: (H, W) of each image, 0 = none; no number is in two images.
            points: (H, W, 3) of each image, world coordinates (m).
        """
        count = max((int(image.max(initial=0)) for image in parts), default=0) + 1
        owner = np.zeros(count, np.int64)
        for number, image in enumerate(parts):
            owner[np.unique(image[image > 0])] = number
        shares = self._shares(parts, points, count)
        mutual_shares = np.maximum(shares, shares.T)
        ambiguous_pairs = _find_ambiguous_pairs(shares, owner, MAJORITY * self.min_ratio)
        mutual_shares[ambiguous_pairs | ambiguous_pairs.T] = 0.0
        return _groups(mutual_shares, owner, self.min_ratio)

    def _shares(
        self, parts: Sequence[Int32], points: Sequence[Float64], count: int
    ) -> NDArray[np.float64]:
        """(P + 1, P + 1): share of a part's points (row) that lie on a part of another image."""
        labelled_points = [
            (image[image > 0], place[image > 0]) for image, place in zip(parts, points, strict=True)
        ]
        trees = [cKDTree(places) if len(places) else None for _, places in labelled_points]
        matches, totals = np.zeros((count, count)), np.zeros(count)
        for labels, _ in labelled_points:
            totals += np.bincount(labels, minlength=count)
        for a, b in permutations(range(len(labelled_points)), 2):
            labels, places = labelled_points[a]
            tree = trees[b]
            if tree is None or not len(labels):
                continue
            distance, row = tree.query(places, distance_upper_bound=self.inlier_distance)
            is_matched = np.isfinite(distance)
            np.add.at(matches, (labels[is_matched], labelled_points[b][0][row[is_matched]]), 1)
        return matches / np.maximum(totals, 1)[:, None]


def _find_ambiguous_pairs(
    shares: NDArray[np.float64], owner: NDArray[np.int64], min_share: float
) -> NDArray[np.bool_]:
    """Pairs (part of an image, part of another) of which the second meets several of that image."""
    ambiguous_pairs = np.zeros(shares.shape, bool)
    for image in np.unique(owner[1:]):
        image_parts = np.flatnonzero(owner == image)
        image_parts = image_parts[image_parts > 0]
        is_ambiguous = (shares[image_parts] >= min_share).sum(axis=0) > 1
        ambiguous_pairs[np.ix_(image_parts, np.flatnonzero(is_ambiguous))] = True
    return ambiguous_pairs


def _groups(
    mutual_shares: NDArray[np.float64], owner: NDArray[np.int64], min_share: float
) -> NDArray[np.int64]:
    """Joins the pair that shares most first, as long as no group gets two parts of an image."""
    members = {part: {part} for part in range(1, len(owner))}
    table = np.arange(len(owner))
    first, second = np.nonzero(np.triu(mutual_shares, 1) >= min_share)
    for row in np.argsort(-mutual_shares[first, second], kind="stable"):
        a, b = int(table[first[row]]), int(table[second[row]])
        if a == b or {owner[p] for p in members[a]} & {owner[p] for p in members[b]}:
            continue
        low, high = min(a, b), max(a, b)
        members[low] |= members.pop(high)
        table[list(members[low])] = low
    return table
