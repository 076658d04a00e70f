"""Colours and sizes that all classes share, so that neither tells one class from another."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from scenefw.core.tabletop import (
    CHECKER,
    DOTS,
    FLORAL,
    GINGHAM,
    NOISE,
    PLAIN,
    PRINT,
    SPECKLE,
    STRIPES,
    WOOD,
)
from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Colour, Look, Part, face_normals

_KINDS = (PLAIN, NOISE, SPECKLE, STRIPES, WOOD, CHECKER, DOTS, FLORAL, GINGHAM, PRINT)
_SHARES = (0.56, 0.12, 0.07, 0.07, 0.05, 0.02, 0.03, 0.03, 0.02, 0.03)


def colour(rng: np.random.Generator) -> Colour:
    """A colour of anything on a desk."""
    kind = rng.choice(6, p=[0.24, 0.14, 0.18, 0.24, 0.12, 0.08])
    if kind == 0:
        return colours.hsv(rng.random(), rng.uniform(0, 0.3), rng.uniform(0.08, 0.3))
    if kind == 1:
        return colours.hsv(rng.random(), rng.uniform(0, 0.1), rng.uniform(0.35, 0.65))
    if kind == 2:
        return colours.hsv(rng.uniform(0.03, 0.2), rng.uniform(0, 0.2), rng.uniform(0.75, 0.97))
    if kind == 3:
        return colours.vivid(rng)
    if kind == 4:
        return colours.hsv(rng.uniform(0.04, 0.12), rng.uniform(0.3, 0.65), rng.uniform(0.4, 0.8))
    return colours.metal(rng)


def look(rng: np.random.Generator, first: Colour | None = None) -> Look:
    """A surface of anything: mostly plain, matt to glossy."""
    first = colour(rng) if first is None else first
    kind = int(rng.choice(_KINDS, p=_SHARES))
    second = colour(rng) if kind in (DOTS, FLORAL, STRIPES) else colours.shade(
        first, rng.choice([0.5, 0.7, 1.5])
    )  # fmt: skip
    if kind == PRINT:
        second = colours.contrast(first, rng)
    periods = {PRINT: (0.003, 0.006), SPECKLE: (0.002, 0.006), WOOD: (0.004, 0.012)}
    period = rng.uniform(*periods.get(kind, (0.006, 0.022)))
    angle = rng.choice([0.0, np.pi / 2, rng.uniform(0, np.pi)])
    gloss = rng.choice([0.0, rng.uniform(0.05, 0.35), rng.uniform(0.4, 0.8)], p=[0.3, 0.45, 0.25])
    return Look(first, kind, period, rng.uniform(0.4, 0.9), angle, second, gloss)


def plain(rng: np.random.Generator, first: Colour | None = None) -> Look:
    """One colour."""
    return Look(colour(rng) if first is None else first, gloss=rng.uniform(0, 0.5))


def repainted(
    pieces: Iterable[Part], rng: np.random.Generator, share: float = 0.75, small: float = 0.2
) -> list[Part]:
    """The same parts with other looks: a `share` of the two largest, few of the others."""
    pieces = list(pieces)
    areas: dict[Look, float] = {}
    for part in pieces:
        area = np.linalg.norm(face_normals(part.vertices[part.faces]), axis=1).sum()
        areas[part.look] = areas.get(part.look, 0.0) + float(area)
    changed = {}
    for place, old in enumerate(sorted(areas, key=lambda skin: -areas[skin])):
        new = look(rng) if place < 2 else plain(rng)
        changed[old] = new if rng.random() < (share if place < 2 else small) else old
    return [replace(part, look=changed[part.look]) for part in pieces]


def sized(pieces: Iterable[Part], size: Sequence[float | None]) -> list[Part]:
    """The same parts stretched to a bounding box (m); None keeps the proportion along an axis."""
    pieces = list(pieces)
    vertices = np.concatenate([part.vertices for part in pieces])
    extent = np.ptp(vertices, axis=0)
    factors = [
        None if to is None else to / max(e, 1e-9) for to, e in zip(size, extent, strict=True)
    ]
    fixed_factors = [factor for factor in factors if factor is not None]
    common = float(np.mean(fixed_factors)) if fixed_factors else 1.0
    matrix = np.diag([common if factor is None else factor for factor in factors])
    return [part.turned(matrix) for part in pieces]


def revolved(profile: Sequence[Sequence[float]], skin: Look, steps: int = 28) -> Part:
    """Solid of revolution about z of a closed profile (K, 2) of radii and heights.

    The profile goes round the material counter-clockwise, radius to the right and height up.
    """
    flat = np.asarray(profile, dtype=np.float64)[::-1]
    turn = 2 * np.pi * np.arange(steps + 1) / steps
    rings = np.stack(
        [np.outer(np.cos(turn), flat[:, 0]), np.outer(np.sin(turn), flat[:, 0]),
         np.broadcast_to(flat[:, 1], (steps + 1, len(flat)))], axis=-1,
    )  # fmt: skip
    return parts.loft(rings, skin, caps=False)


def ring(inner: float, outer: float, low: float, high: float, skin: Look, steps: int = 28) -> Part:
    """A flat ring about z."""
    return revolved([(inner, low), (outer, low), (outer, high), (inner, high)], skin, steps)


def slab(rng: np.random.Generator, size: Sequence[float], skin: Look, corner: float = 0.0) -> Part:
    """A plate on the table with round corners (`corner`: radius by width) and a small bevel."""
    length, width, height = size
    outline = parts.rounded(length, width, corner * width, 4) if corner else parts.rectangle(
        length, width
    )  # fmt: skip
    bevel = min(rng.uniform(0.0005, 0.003), 0.3 * height)
    return parts.plate(outline, 0.0, height, skin, bevel)


def upon(outline: np.ndarray, height: float, skin: Look, rise: float = 0.0003) -> Part:
    """Something thin on top of a model."""
    return parts.plate(outline, height - 0.0004, height + rise, skin)
