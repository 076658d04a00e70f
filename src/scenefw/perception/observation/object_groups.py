"""Groups of objects on a table, seen from above, and the cube about those that fit into it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage
from skimage import measure

from scenefw.core.errors import InputError
from scenefw.perception.observation.points import MIN_POINTS
from scenefw.perception.observation.raster import GAP, FloorRaster

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64

_RASTER = FloorRaster()
MAX_UNSAID_RATIO = 0.05
"""Ratio of what rises above the floor that may be left out without a word."""


@dataclass(frozen=True)
class ObjectGroup:
    """A group of objects that (nearly) touch.

    Args:
        label: number in the raster.
        cells: (N, 2) centres of its cells (m).
        weight: of its pixels; the middle of an image weighs most.
    """

    label: int
    cells: Float64
    weight: float


def pixel_weights(shape: tuple[int, ...]) -> Float64:
    """Weights (H, W), 1 in the middle of an image and 0 in its corners: it is about its middle."""
    middle = (np.array(shape) - 1) / 2
    rows, columns = np.indices(shape) - middle[:, None, None]
    return np.asarray((1 - np.hypot(rows, columns) / np.hypot(*middle)) ** 2)


def object_groups(
    points: Float64, weights: Float64, side: float
) -> tuple[NDArray[np.int32], list[ObjectGroup]]:
    """Raster of group numbers, and the groups of object points (N, 3) that are not noise.

    Objects beside each other are one group; if it doesn't fit into a square of `side` (m), only
    those that touch are. If even these don't, but nearly all of their points do, the others are
    noise: where a sensor blurs edges, slopes lead from an object to what is far behind it.
    """
    counts = _RASTER.count(points)
    sums = _RASTER.count(points, weights)
    occupied = counts > 0
    labels = np.where(occupied, measure.label(ndimage.binary_dilation(occupied)), 0)
    for label in range(1, labels.max(initial=0) + 1):
        mask = labels == label
        if np.ptp(_RASTER.centres(mask), axis=0).max() > side:
            labels = np.where(mask, measure.label(mask) + labels.max(), labels)
    groups = []
    for label in np.unique(labels[occupied]):
        mask = labels == label
        if np.ptp(_RASTER.centres(mask), axis=0).max() > side:
            outside = mask & ~_fullest_square(np.where(mask, counts, 0), side)
            if counts[outside].sum() <= MAX_UNSAID_RATIO * counts[mask].sum():
                labels = np.where(outside, 0, labels)
                mask &= ~outside
        if mask.sum() >= GAP**2 and counts[mask].sum() >= MIN_POINTS:  # no gap is an object
            groups.append(ObjectGroup(int(label), _RASTER.centres(mask), float(sums[mask].sum())))
    return labels, groups


def _fullest_square(counts: NDArray[np.int64], side: float) -> NDArray[np.bool_]:
    """The square of `side` (m) that holds most points, by their numbers in each cell."""
    width = int(side / _RASTER.cell)
    sums = np.pad(counts.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    rows = sums[width:] - sums[:-width]
    held = rows[:, width:] - rows[:, :-width]
    row, column = np.unravel_index(held.argmax(), held.shape)
    square = np.zeros(counts.shape, dtype=bool)
    square[row : row + width, column : column + width] = True
    return square


def fitting_groups(
    groups: list[ObjectGroup], side: float, name: str
) -> tuple[Float64, list[ObjectGroup]]:
    """Centre (2,) and members of the heaviest set of groups that a square of `side` holds.

    Each group in turn takes in its neighbours, nearest first, as long as all fit.
    """
    best: list[ObjectGroup] = []
    for seed in groups:
        members: list[ObjectGroup] = []
        for group in sorted(groups, key=lambda g: _distance(seed, g)):
            if _span([*members, group]).max() <= side:
                members.append(group)
        if sum(g.weight for g in members) > sum(g.weight for g in best):
            best = members
    if not best:
        largest = _span([max(groups, key=lambda g: g.weight)])
        raise InputError(
            f"objects of {name} cover {largest[0]:.2f} m x {largest[1]:.2f} m without a gap, the "
            f"cube holds {side:.2f} m; show fewer objects, or check depth scale and intrinsics"
        )
    cells = np.concatenate([g.cells for g in best])
    return (cells.min(axis=0) + cells.max(axis=0)) / 2, best


def _span(groups: list[ObjectGroup]) -> Float64:
    return np.ptp(np.concatenate([g.cells for g in groups]), axis=0)


def _distance(a: ObjectGroup, b: ObjectGroup) -> float:
    return float(np.linalg.norm(a.cells.mean(axis=0) - b.cells.mean(axis=0)))
