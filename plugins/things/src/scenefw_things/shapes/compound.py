"""Things without a name: one to nine convex solids joined at random, with pieces cut out."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from scenefw.core.geometry import random_quaternion, rotation_from_quaternion
from scenefw.core.types import Float64
from scenefw_things.shapes.family import family
from scenefw_things.shapes.solids import (
    Part,
    box,
    difference,
    ellipsoid,
    lathe,
    painted,
    ring,
    rounded_box,
    tube,
)

Rng = np.random.Generator
_CUTTER_SIDES = 8
_APART = 1e-9  # m: solids that are farther apart don't touch


def _solids(rng: Rng, size: float) -> list[Float64]:
    """One random primitive about the origin, `size` long; several pieces where it is hollow."""
    slim = rng.uniform(0.25, 1.0, 2)
    kind = int(rng.integers(7))
    sides = int(rng.choice([3, 4, 5, 6, 16, 20]))
    if kind == 0:
        return [box((size, *(slim * size)))]
    if kind == 1:
        return [rounded_box((size, *(slim * size)), rng.uniform(0.05, 0.3) * slim.min() * size)]
    if kind == 2:
        return [ellipsoid((size / 2, *(slim * size / 2)), sides=12)]
    if kind == 3:
        top = rng.uniform(0.0, 1.0) if rng.random() < 0.5 else 1.0
        wide = slim[0] * size / 2
        return [lathe([(wide, -size / 2), (top * wide, size / 2)], sides)]
    if kind == 4:
        wide = 0.3 * slim[0] * size
        return tube(np.array([[0, 0, wide - size / 2], [0, 0, size / 2 - wide]]), wide, sides=12)
    if kind == 5:
        outer, tall = size / 2, 0.3 * slim[0] * size
        inner = rng.uniform(0.4, 0.8) * outer
        sweep = 2 * np.pi if rng.random() < 0.5 else rng.uniform(1.5, 5.0)
        return ring([(inner, -tall), (outer, -tall), (outer, tall), (inner, tall)], 14, 0.0, sweep)
    knots = np.cumsum(rng.normal(0, 0.25 * size, (4, 3)), axis=0)
    return tube(knots - knots.mean(axis=0), 0.12 * size * slim[0] + 0.003, sides=8)


@family(size=(0.04, 0.14), pieces=(1, 9.99), spread=(0.3, 0.7), cuts=(0, 3.99), cut=(0.3, 0.8))
def compound(
    rng: Rng, *, size: float, pieces: float, spread: float, cuts: float, cut: float
) -> list[Part]:
    """Primitives, each with its middle on one before, then cut by boxes and prisms.

    Args:
        rng: draws kinds, places and turns.
        size: of the largest primitive.
        pieces: number of primitives, rounded down.
        spread: smallest size of a primitive by the largest.
        cuts: number of cuts, rounded down; a cut that would leave nothing is left out.
        cut: size of what is cut out by `size`.
    """
    parts: list[Part] = []
    centres = [np.zeros(3)]
    for number in range(int(pieces)):
        scale = size if number == 0 else size * rng.uniform(spread, 1.0)
        turn = rotation_from_quaternion(random_quaternion(rng))
        centre = centres[int(rng.integers(len(centres)))]
        if number:
            ahead = rng.normal(size=3)
            centre = centre + 0.45 * size * ahead / np.linalg.norm(ahead)
        centres.append(centre)
        placed = [piece @ turn.T + centre for piece in _solids(rng, scale)]
        parts += painted(number % 3, placed)
    for _ in range(int(cuts)):
        parts = _cut(parts, rng, cut * size, centres[int(rng.integers(len(centres)))])
    return _largest(parts)


def _cut(parts: list[Part], rng: Rng, size: float, centre: Float64) -> list[Part]:
    """The parts without a box or a prism that lies beside a centre, if something stays."""
    turn = rotation_from_quaternion(random_quaternion(rng))
    slim = rng.uniform(0.3, 1.0)
    flat = rng.random() < 0.5
    cutter = (box((size, slim * size, 1.5 * size)) if flat
              else lathe([(slim * size / 2, -0.75 * size), (slim * size / 2, 0.75 * size)],
                         _CUTTER_SIDES))  # fmt: skip
    ahead = rng.normal(size=3)
    cutter = cutter @ turn.T + centre + 0.4 * size * ahead / np.linalg.norm(ahead)
    low, high = cutter.min(axis=0), cutter.max(axis=0)
    rest: list[Part] = []
    for part in parts:
        apart = (part.corners.min(axis=0) >= high).any() or (part.corners.max(axis=0) <= low).any()
        pieces = [part.corners] if apart else difference(part.corners, cutter)
        rest += painted(part.paint, pieces)
    return rest or parts


def _largest(parts: list[Part]) -> list[Part]:
    """The parts that hang together and fill the largest volume; cuts leave shreds."""
    hulls = [ConvexHull(part.corners) for part in parts]
    planes = [np.unique(hull.equations.round(9), axis=0) for hull in hulls]
    touching = np.eye(len(parts), dtype=bool)
    for i in range(len(parts)):
        for j in range(i):
            apart = _separates(planes[i], parts[j].corners) or _separates(
                planes[j], parts[i].corners
            )
            touching[i, j] = not apart
    count, group = connected_components(touching, directed=False)
    volumes = np.bincount(group, [hull.volume for hull in hulls], count)
    return [part for part, label in zip(parts, group, strict=True) if label == volumes.argmax()]


def _separates(planes: Float64, corners: Float64) -> bool:
    """Whether one of the planes (K, 4) has all corners before it."""
    height = corners @ planes[:, :3].T + planes[:, 3]
    return bool((height.min(axis=0) > _APART).any())
