"""Where objects of a scene run into each other or the floor, and which of them nothing carries."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from scenefw.perception.evidence.mesh_distances import MeshDistances, distances_to
from scenefw.perception.observation.components import DETAIL
from scenefw.perception.observation.points import SAMPLE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Float64, ObjectEstimate


@dataclass(frozen=True)
class Overlap:
    """Of two objects, or of one with the floor.

    Args:
        first: id.
        second: id of the other one, or `FLOOR`.
        depth: how far they run into each other (m).
        volume: that both fill (m^3); NaN for the floor.
    """

    FLOOR: ClassVar[int] = 0  # stands for the floor z = 0 among ids of objects

    first: int
    second: int
    depth: float
    volume: float


@dataclass(frozen=True)
class Hover:
    """Of an object that nothing carries.

    Args:
        id: of the object.
        gap: how far it can sink straight down (m).
        below: id of what it would meet, or `Overlap.FLOOR`.
    """

    id: int
    gap: float
    below: int


def overlaps(objects: Sequence[ObjectEstimate], tolerance: float = DETAIL) -> list[Overlap]:
    """Pairs of objects, and objects and the floor, that share more than touching ones do.

    Args:
        objects: closed meshes, world coordinates.
        tolerance: depth that counts as touching (m).
    """
    solids = {item.id: distances_to(item.mesh) for item in objects}
    candidates = [
        Overlap(label, Overlap.FLOOR, -float(solid.low[2]), float("nan"))
        for label, solid in solids.items()
    ]
    candidates += [_overlap(a, solids[a], b, solids[b]) for a, b in combinations(solids, 2)]
    return [overlap for overlap in candidates if overlap.depth > tolerance]


def hovers(objects: Sequence[ObjectEstimate], tolerance: float = DETAIL) -> list[Hover]:
    """Objects with neither the floor nor another object below them within the tolerance.

    An object that leans out too far is carried all the same: whether a pile stands, a simulation
    says.

    Args:
        objects: closed meshes, world coordinates.
        tolerance: gap that counts as touching (m).
    """
    solids = {item.id: distances_to(item.mesh) for item in objects}
    candidates = [_hover(label, solids) for label in solids]
    return [hover for hover in candidates if hover.gap > tolerance]


def _overlap(a: int, first: MeshDistances, b: int, second: MeshDistances) -> Overlap:
    low, high = np.maximum(first.low, second.low), np.minimum(first.high, second.high)
    if (low >= high).any():
        return Overlap(a, b, 0.0, 0.0)
    points = _lattice(low, high)
    shared = points[first.inside(points)]
    shared = shared[second.inside(shared)]
    volume = float((high - low).prod()) * len(shared) / len(points)
    depths = -(first.at(shared) + second.at(shared))  # thickness of what both fill, about there
    return Overlap(a, b, float(depths.max(initial=0.0)), volume)


def _hover(label: int, solids: dict[int, MeshDistances]) -> Hover:
    upper = solids[label]
    best = Hover(label, max(float(upper.low[2]), 0.0), Overlap.FLOOR)
    for lower_label, lower in solids.items():
        if lower_label == label or (lower.high[:2] < upper.low[:2]).any():
            continue
        if (lower.low[:2] > upper.high[:2]).any() or lower.low[2] > upper.high[2]:
            continue
        places = shared_places(upper, lower)
        bottom, top, underside = upper.lowest(places), lower.highest(places), lower.lowest(places)
        with np.errstate(invalid="ignore"):
            is_below = underside < bottom  # what comes from above, however deep, carries nothing
            gaps = np.maximum(bottom - top, 0)[is_below]
        if len(gaps) and gaps.min() < best.gap:
            best = Hover(label, float(gaps.min()), lower_label)
    return best


def shared_places(first: MeshDistances, second: MeshDistances) -> Float64:
    """Places (N, 2) of the floor under both: a lattice of `DETAIL` or more, and their vertices."""
    low = np.maximum(first.low, second.low)[:2]
    high = np.minimum(first.high, second.high)[:2]
    counts = np.minimum(np.ceil((high - low) / DETAIL) + 1, math.isqrt(SAMPLE)).astype(int)
    axes = [np.linspace(*ends) for ends in zip(low, high, counts, strict=True)]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    corners = []
    for solid in (first, second):
        vertices = solid.vertices[:: len(solid.vertices) // SAMPLE + 1, :2]
        corners.append(vertices[((vertices >= low) & (vertices <= high)).all(axis=1)])
    return np.concatenate([lattice, *corners])


def _lattice(low: Float64, high: Float64) -> Float64:
    """Middles (N, 3) of the cells of a box."""
    count = round(SAMPLE ** (1 / 3))
    steps = (np.arange(count) + 0.5) / count
    axes = [a + steps * (b - a) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
