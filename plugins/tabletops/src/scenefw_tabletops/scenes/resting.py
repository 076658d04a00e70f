"""Resting poses on whatever lies there already: planes over a relief of heights.

A rigid thing that is put down and may tilt comes to rest where its centre of mass is lowest. For
small tilts its underside moves like a plane a x + b y + c, and contact means that the plane added
to the underside is nowhere below the relief. The lowest such plane at the centre of mass is the
face of the upper convex hull of (x, y, relief - underside) over that point; the corners of that
face are the points of contact, about the centre, so the pose is stable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from scenefw.kernels.meshes import NOTHING, Tree

Array = NDArray[np.float64]

_SPACING = (0.001, 0.0022)  # m between columns of small and of large things
_LEVEL = 0.0004  # m: contacts that differ less are level
_BINS = 12


@dataclass(frozen=True, eq=False)
class Body:
    """A model at rest as columns of material.

    Args:
        low: (P, 3) its underside and the corners of its convex hull, in order of `bins`.
        high: (P, 3) its top over the same places.
        centre: (3,) centre of mass.
        bins: (B,) first point of each group of neighbouring points.
        radius: of a circle about the origin that it fits into (m).
    """

    low: Array
    high: Array
    centre: Array
    bins: NDArray[np.int64]
    radius: float


def body_of(vertices: Array, faces: NDArray[np.int64]) -> Body:
    """The columns of a mesh, by rays from below and above."""
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    size = upper - lower
    step = min(float(np.clip(size.max() / 100, *_SPACING)), max(size[:2].min() / 8, 4e-4))
    along = [np.arange(lower[k] + step / 2, upper[k], step) for k in range(2)]
    x, y = (grid.ravel() for grid in np.meshgrid(*along))
    tree = Tree((vertices[faces]).astype(np.float32))
    top, hit = _cast(tree, x, y, upper[2] + 0.01, -1.0)
    bottom, _ = _cast(tree, x, y, lower[2] - 0.01, 1.0)
    low = np.column_stack([x, y, bottom])[hit]
    high = np.column_stack([x, y, np.maximum(top, bottom)])[hit]
    corners = vertices[ConvexHull(vertices).vertices]  # what rays between them miss
    low, high = np.concatenate([low, corners]), np.concatenate([high, corners])
    cell = ((low[:, :2] - lower[:2]) / np.maximum(size[:2], 1e-9) * _BINS).astype(int)
    key = np.minimum(cell[:, 0], _BINS - 1) * _BINS + np.minimum(cell[:, 1], _BINS - 1)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    weight = np.maximum(high[:, 2] - low[:, 2], 1e-4)[:, None]
    centre = ((low + high) / 2 * weight).sum(axis=0) / weight.sum()
    radius = float(np.linalg.norm(vertices[:, :2], axis=1).max())
    return Body(low[order], high[order], centre, first, radius)


def _cast(tree: Tree, x: Array, y: Array, start: float, way: float) -> tuple[Array, NDArray]:
    """Heights where upright rays meet a mesh, and which do."""
    import torch

    rays = np.zeros((len(x), 6), dtype=np.float32)
    rays[:, 0], rays[:, 1], rays[:, 2], rays[:, 5] = x, y, start, way
    distance, hit, _ = tree.cast(torch.from_numpy(rays), table=False)
    return start + way * distance.numpy().astype(np.float64), hit.numpy() != NOTHING


class Relief:
    """Heights of what lies on a square of table.

    Args:
        extent: side of the square about the origin (m).
        cell: side of a cell (m).
    """

    def __init__(self, extent: float, cell: float = 0.002) -> None:
        self.half, self.cell = extent / 2, cell
        self.side = int(np.ceil(extent / cell))
        self.heights = np.zeros((self.side, self.side))

    def inside(self, points: Array) -> bool:
        """Whether points (P, 2 or 3) lie over the square."""
        return bool(np.abs(points[:, :2]).max() < self.half - self.cell)

    def at(self, points: Array) -> Array:
        """Heights under points (..., 2 or 3), which lie over the square."""
        place = ((points[..., :2] + self.half) * (1 / self.cell)).astype(np.int32)
        return np.asarray(self.heights.ravel()[place[..., 0] * self.side + place[..., 1]])

    def raise_to(self, points: Array) -> None:
        """Puts points (P, 3) on it."""
        place = ((points[:, :2] + self.half) * (1 / self.cell)).astype(np.int64)
        place = np.clip(place, 0, self.side - 1)
        np.maximum.at(self.heights.ravel(), place[:, 0] * self.side + place[:, 1], points[:, 2])


@dataclass(frozen=True, eq=False)
class Rest:
    """How a body lies: rotation (3, 3), origin (3,), tilt (rad), largest gap under it (m)."""

    rotation: Array
    origin: Array
    tilt: float
    hollow: float

    def moved(self, points: Array) -> Array:
        """Points (P, 3) of the model in the world."""
        return points @ self.rotation.T + self.origin


def resting_pose(
    body: Body,
    relief: Relief,
    place: Array,
    rotation: Array,
    scale: float,
    steepest: float,
    highest: float = np.inf,
) -> Rest | None:
    """A body put down at a place (2,), turned by a rotation (3, 3) about z first.

    None if it would lie outside, steeper than `steepest` (rad), or on anything that is higher than
    `highest` (m).
    """
    low, centre = scale * body.low, scale * body.centre
    origin, tilt = np.array([*place, 0.0]), 0.0
    for _ in range(3):
        under = low @ rotation.T + origin
        if not relief.inside(under):
            return None
        need = relief.at(under) - under[:, 2]
        if need.max() > highest:
            return None
        if np.ptp(need) < _LEVEL:
            break
        middle = rotation @ centre + origin
        slope = _slope(under, need, body.bins, middle)
        if np.hypot(*slope) < 0.004:
            break
        turn = _tilted(slope)
        rotation = turn @ rotation
        origin = middle + turn @ (origin - middle)
        tilt = float(np.arccos(np.clip(rotation[2, 2], -1, 1)))
        if tilt > steepest:
            return None
    under = low @ rotation.T + origin
    if not relief.inside(under):
        return None
    gap = under[:, 2] - relief.at(under)
    lift = -gap.min()
    origin = origin + [0, 0, lift]
    return Rest(rotation, origin, tilt, float(np.quantile(gap + lift, 0.7)))


def _slope(under: Array, need: Array, bins: NDArray[np.int64], middle: Array) -> Array:
    """Slope (2,) of the lowest plane over the needed heights at the centre of mass."""
    maxima = np.maximum.reduceat(need, bins)
    counts = np.diff([*bins, len(need)])
    place = np.flatnonzero(need == np.repeat(maxima, counts))
    points = np.column_stack([under[place, :2], need[place]])
    span = np.ptp(points[:, :2], axis=0).max()
    if len(points) < 4 or span < 1e-3:
        return np.zeros(2)
    far = np.array([[*middle[:2], points[:, 2].min() - 10 * span]])  # so that it has a volume
    try:
        hull = ConvexHull(np.concatenate([points, far]), qhull_options="QJ Pp")
    except QhullError:  # all on a line
        return np.zeros(2)
    a, b, c, d = hull.equations[hull.equations[:, 2] > 1e-9].T
    height = -(a * middle[0] + b * middle[1] + d) / c
    lowest = np.argmin(height)
    return np.array([-a[lowest] / c[lowest], -b[lowest] / c[lowest]])


def _tilted(slope: Array) -> Array:
    """Rotation (3, 3) that tilts the plane z = 0 to a slope (2,)."""
    up = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1 + slope @ slope)
    axis = np.array([-up[1], up[0], 0.0])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + up[2]))
