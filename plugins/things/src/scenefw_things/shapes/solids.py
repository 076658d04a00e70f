"""Convex solids as corners (K, 3) in metres, and lists of them for what is bent, hollow or cut.

All stand in one frame, z up. Neighbouring pieces of a ring or a tube share a whole side, corner by
corner, so that their union has no seam.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from scenefw.core.types import Float64

SIDES = 24
"""Of what is round: a circle of 4 cm radius is missed by 0.3 mm."""

_TUBE_SIDES = 10
_ASKEW = np.array([[0.955, 0.296], [-0.296, 0.955]])  # so that no edge lies on another's edge
_TINY = 1e-9  # m: what is thinner is nothing
_MIN_VOLUME = 1e-12  # m^3: of a piece that a cut leaves, a cube of 0.1 mm


Point = Sequence[float] | Float64


class Part(NamedTuple):
    """A convex part of a thing.

    Args:
        corners: (K, 3) m.
        paint: number of the paint that it has; parts of one number look alike.
    """

    corners: Float64
    paint: int = 0


def painted(paint: int, *solids: Float64 | Iterable[Float64]) -> list[Part]:
    """Solids, and lists of solids, as parts of one paint."""
    parts: list[Part] = []
    for solid in solids:
        pieces = [solid] if isinstance(solid, np.ndarray) else solid
        parts += [Part(piece, paint) for piece in pieces]
    return parts


def circle(radius: float, sides: int = SIDES) -> Float64:
    """Corners (sides, 2) of a regular polygon about the origin."""
    angle = 2 * np.pi * np.arange(sides) / sides
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def prism(outline: Float64, low: float, high: float, narrowing: float = 1.0) -> Float64:
    """An outline (K, 2) between two heights, at the upper one scaled by `narrowing`."""
    bottom = np.column_stack([outline, np.full(len(outline), low)])
    top = np.column_stack([outline * narrowing, np.full(len(outline), high)])
    return np.concatenate([bottom, top])


def box(size: Point, centre: Point = (0.0, 0.0, 0.0)) -> Float64:
    """A box along the axes."""
    signs = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(signs * size + centre)


def rounded_box(
    size: Point, radius: float, centre: Point = (0.0, 0.0, 0.0), steps: int = 3
) -> Float64:
    """A box whose edges are rounded with a radius (m), less where its sides are short."""
    radius = min(radius, 0.49 * min(size))
    turn = np.linspace(0, np.pi / 2, steps)
    ring = np.array([[np.cos(t) * np.cos(e), np.sin(t) * np.cos(e), np.sin(e)]
                     for e in turn for t in turn])  # fmt: skip
    corner = np.unique(ring.round(12), axis=0) * radius + (np.asarray(size) / 2 - radius)
    signs = np.sign(box((2, 2, 2)))
    return np.concatenate([corner * sign for sign in signs]) + centre


def lathe(profile: Sequence[tuple[float, float]], sides: int = SIDES) -> Float64:
    """The hull of circles about z, one for each (radius, height) of a convex profile."""
    rings = [prism(circle(r, sides), z, z)[:sides] if r > _TINY else np.array([[0.0, 0.0, z]])
             for r, z in profile]  # fmt: skip
    return np.concatenate(rings)


def ring(
    profile: Sequence[tuple[float, float]],
    sides: int = SIDES,
    start: float = 0.0,
    sweep: float = 2 * np.pi,
) -> list[Float64]:
    """A convex profile of (radius, height) turned about z: one piece for each of its sides.

    Args:
        profile: corners, none left of the axis (m).
        sides: of a full turn.
        start: where the turn begins (rad).
        sweep: how far it goes (rad).
    """
    radius, height = np.array(profile).T
    full = sweep >= 2 * np.pi - 1e-9
    count = sides if full else max(1, round(sides * sweep / (2 * np.pi)))
    angles = start + sweep * np.arange(count + 1) / count
    if full:
        angles[-1] = angles[0]
    slices = [
        np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
        for angle in angles
    ]
    return [np.concatenate(pair) for pair in pairwise(slices)]


def wall(
    outer: Sequence[tuple[float, float]], thickness: float, sides: int = SIDES
) -> list[Float64]:
    """A shell about z of even thickness, measured along the radius, below (radius, height)s."""
    pieces: list[Float64] = []
    for (r0, z0), (r1, z1) in pairwise(outer):
        pieces += ring([(r0 - thickness, z0), (r0, z0), (r1, z1), (r1 - thickness, z1)], sides)
    return pieces


def ellipsoid(radii: Point, centre: Point = (0.0, 0.0, 0.0), sides: int = 16) -> Float64:
    """Corners on an ellipsoid along the axes, on parallels about z."""
    elevation = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 1)
    profile = [(float(np.cos(e)), float(np.sin(e))) for e in elevation]
    return lathe(profile, sides) * radii + centre


def tube(
    path: Float64, radii: Float64 | float, flatness: float = 1.0, sides: int = _TUBE_SIDES
) -> list[Float64]:
    """A bent rod: one piece between each two of its cross-sections, its ends rounded.

    Args:
        path: (N, 3) centres of the cross-sections (m).
        radii: of the cross-sections (m), one or (N,).
        flatness: of the cross-sections along their second axis, 1 = round.
        sides: of the cross-sections.
    """
    path = np.asarray(path, dtype=np.float64)
    radii = np.broadcast_to(np.asarray(radii, dtype=np.float64), len(path))
    ahead = np.gradient(path, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    path = np.concatenate([[path[0] - 0.6 * radii[0] * ahead[0]], path,
                           [path[-1] + 0.6 * radii[-1] * ahead[-1]]])  # fmt: skip
    radii = np.concatenate([[0.55 * radii[0]], radii, [0.55 * radii[-1]]])
    ahead = np.concatenate([ahead[:1], ahead, ahead[-1:]])
    up = np.eye(3)[np.abs(ahead.mean(axis=0)).argmin()]
    sections = []
    for centre, radius, direction in zip(path, radii, ahead, strict=True):
        across = np.cross(up, direction)
        across /= np.linalg.norm(across)
        up = np.cross(direction, across)
        flat = circle(radius, sides) @ _ASKEW
        sections.append(centre + flat[:, :1] * across + flatness * flat[:, 1:] * up)
    return [np.concatenate(pair) for pair in pairwise(sections)]


def arc(
    centre: Sequence[float],
    radius: float,
    start: float,
    end: float,
    steps: int = 7,
    stretch: float = 1.0,
) -> Float64:
    """Points (steps, 3) on an arc in the plane of x and z, stretched along z."""
    angle = np.linspace(start, end, steps)
    flat = np.zeros_like(angle)
    offset = np.column_stack([radius * np.cos(angle), flat, stretch * radius * np.sin(angle)])
    return np.asarray(offset + centre)


def rotation(axis: int, angle: float) -> Float64:
    """Turn (3, 3) about x, y or z (0, 1, 2) by an angle (rad)."""
    turn, (i, j) = np.eye(3), ((axis + 1) % 3, (axis + 2) % 3)
    turn[i, i] = turn[j, j] = np.cos(angle)
    turn[j, i], turn[i, j] = np.sin(angle), -np.sin(angle)
    return turn


def moved(
    parts: Iterable[Part], turn: Float64 | None = None, shift: Sequence[float] = (0.0, 0.0, 0.0)
) -> list[Part]:
    """Parts that are turned about the origin, then shifted (m)."""
    turn = np.eye(3) if turn is None else turn
    return [Part(part.corners @ turn.T + shift, part.paint) for part in parts]


def below(corners: Float64, normal: Float64, offset: float) -> Float64 | None:
    """What of a convex solid lies where normal . x <= offset; None if that is next to nothing."""
    height = corners @ normal - offset
    if height.max() <= _TINY:
        return corners
    if height.min() >= -_TINY:
        return None
    low, high = corners[height <= 0], corners[height > 0]
    down, up = -height[height <= 0][:, None], height[height > 0][None]
    share = (down / (down + up))[..., None]
    cuts = (low[:, None] * (1 - share) + high[None] * share).reshape(-1, 3)
    return _extreme(np.concatenate([low, cuts]))


def difference(solid: Float64, cutter: Float64) -> list[Float64]:
    """What a convex cutter leaves of a convex solid: pieces that touch, but don't overlap."""
    planes = np.unique(ConvexHull(cutter).equations.round(9), axis=0)
    if ((solid @ planes[:, :3].T + planes[:, 3]).min(axis=0) >= -_TINY).any():
        return [solid]
    pieces, remainder = [], solid
    for plane in planes:
        outside = below(remainder, -plane[:3], float(plane[3]))
        if outside is not None:
            pieces.append(outside)
        inside = below(remainder, plane[:3], -float(plane[3]))
        if inside is None:
            return [solid]
        remainder = inside
    return pieces


def _extreme(points: Float64) -> Float64 | None:
    try:
        hull = ConvexHull(points)
    except QhullError:
        return None
    return points[np.sort(hull.vertices)] if hull.volume > _MIN_VOLUME else None
