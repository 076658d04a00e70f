"""Building blocks of models: rings of points joined into solids, each with colour and texture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenefw.core.tabletop import PLAIN, TexturedMesh

Array = NDArray[np.float64]
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Look:
    """Colour and texture of a part; see `core.tabletop` for the numbers.

    Args:
        colour: linear, in 0..1.
        kind: of texture.
        period: size of its pattern (m).
        strength: share of the second colour where the pattern is full.
        angle: of its direction in the x-y plane (rad).
        second: the pattern's colour.
        gloss: strength of the highlight.
    """

    colour: Colour
    kind: int = PLAIN
    period: float = 0.01
    strength: float = 0.0
    angle: float = 0.0
    second: Colour = (0.0, 0.0, 0.0)
    gloss: float = 0.0

    def texture(self) -> tuple[float, ...]:
        """Its row of numbers."""
        return (self.kind, self.period, self.strength, self.angle, *self.second, self.gloss)


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one look; vertices that smooth faces share get one normal."""

    vertices: Array
    faces: NDArray[np.int64]
    look: Look
    smooth: bool = False

    def moved(self, offset: ArrayLike) -> Part:
        """Elsewhere."""
        return replace(self, vertices=self.vertices + np.asarray(offset, dtype=np.float64))

    def turned(self, matrix: ArrayLike) -> Part:
        """Multiplied by a 3x3 matrix; a reflection turns the faces round."""
        matrix = np.asarray(matrix, dtype=np.float64)
        faces = self.faces if np.linalg.det(matrix) > 0 else self.faces[:, ::-1]
        return replace(self, vertices=self.vertices @ matrix.T, faces=faces)


def loft(rings: ArrayLike, look: Look, *, smooth: bool = False, caps: bool = True) -> Part:
    """Solid through rings (R, K, 3), counter-clockwise about the way from the first to the last."""
    rings = np.asarray(rings, dtype=np.float64)
    count, size, _ = rings.shape
    vertices = rings.reshape(-1, 3)
    if caps:  # on vertices of their own: an end is an edge, also of a smooth side
        vertices = np.concatenate([vertices, rings[0], rings[-1]])
    return Part(vertices, _loft_faces(count, size, caps), look, smooth)


@lru_cache(maxsize=256)
def _loft_faces(count: int, size: int, caps: bool) -> NDArray[np.int64]:
    number = np.arange(count * size).reshape(count, size)
    following = np.roll(number, -1, axis=1)
    a, b, c, d = number[:-1], following[:-1], following[1:], number[1:]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    if caps:
        start = count * size
        bottom, top = start + np.arange(size), start + size + np.arange(size)
        faces = np.concatenate([faces, _fan(bottom[::-1]), _fan(top)])
    return faces


def plate(outline: ArrayLike, low: float, high: float, look: Look, bevel: float = 0.0) -> Part:
    """Convex outline (K, 2), counter-clockwise, from z = low to high; `bevel` rounds its top."""
    flat = np.asarray(outline, dtype=np.float64)
    levels = [(low, 0.0), (high, 0.0)]
    if bevel > 0:
        levels = [(low, 0.0), (high - bevel, 0.0), (high - 0.3 * bevel, 0.3 * bevel), (high, bevel)]
    rings = [
        np.column_stack([shrunk(flat, inset), np.full(len(flat), height)])
        for height, inset in levels
    ]
    return loft(rings, look)


def box(size: Sequence[float], centre: Sequence[float], look: Look, bevel: float = 0.0) -> Part:
    """Box with its middle at `centre`, its upper edges bevelled."""
    width, depth, height = size
    x, y, z = centre
    return plate(rectangle(width, depth) + [x, y], z - height / 2, z + height / 2, look, bevel)


def tube(path: ArrayLike, radius: float, look: Look, sides: int = 8) -> Part:
    """Round wire along points (P, 3)."""
    path = np.asarray(path, dtype=np.float64)
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    frame = _perpendicular(along[0])
    turn = 2 * np.pi * np.arange(sides) / sides
    rings = []
    for point, ahead in zip(path, along, strict=True):
        frame = frame - ahead * (frame @ ahead)  # carried along without twisting
        frame /= np.linalg.norm(frame)
        binormal = np.cross(ahead, frame)
        rings.append(
            point + radius * (np.cos(turn)[:, None] * frame + np.sin(turn)[:, None] * binormal)
        )
    return loft(rings, look, smooth=True)


def lathe(profile: ArrayLike, look: Look, sides: int = 16) -> Part:
    """Solid of revolution about x: profile (R, 2) of positions along x and radii."""
    turn = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.zeros(sides), np.cos(turn), np.sin(turn)])
    rings = [[x, 0, 0] + radius * circle for x, radius in np.asarray(profile, dtype=np.float64)]
    return loft(rings, look, smooth=True)


def rectangle(width: float, depth: float) -> Array:
    """Outline (4, 2) about the origin."""
    return np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [width / 2, depth / 2]


def rounded(width: float, depth: float, radius: float, steps: int = 4) -> Array:
    """Outline of a rectangle about the origin with round corners."""
    radius = min(radius, 0.499 * width, 0.499 * depth)
    turn = np.linspace(0, np.pi / 2, steps)
    corner = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    half = np.array([width / 2 - radius, depth / 2 - radius])
    quarters = []
    for number, signs in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angle = number * np.pi / 2
        turned = corner @ [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        quarters.append(turned + half * signs)
    return np.concatenate(quarters)


def ellipse(width: float, depth: float, steps: int = 16) -> Array:
    """Outline of an ellipse about the origin."""
    turn = 2 * np.pi * np.arange(steps) / steps
    return np.column_stack([np.cos(turn) * width / 2, np.sin(turn) * depth / 2])


def shrunk(outline: Array, inset: float) -> Array:
    """Outline scaled about its middle so that its sides move in by `inset` or less."""
    if inset == 0:
        return outline
    low, high = outline.min(axis=0), outline.max(axis=0)
    middle, half = (low + high) / 2, (high - low) / 2
    return middle + (outline - middle) * (1 - np.minimum(inset / half, 0.95))


def merge(parts: Iterable[Part]) -> TexturedMesh:
    """One model at rest: footprint about the origin, lowest point at z = 0."""
    parts = list(parts)
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    vertices = np.concatenate([part.vertices for part in parts])
    faces = np.concatenate([p.faces + start for p, start in zip(parts, starts, strict=False)])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = np.array([*(low + high)[:2] / 2, low[2]])
    row = {look: i for i, look in enumerate(dict.fromkeys(part.look for part in parts))}
    sizes = [len(part.faces) for part in parts]
    return TexturedMesh(
        vertices - middle,
        faces,
        _normals(vertices, faces, np.repeat([part.smooth for part in parts], sizes)),
        np.repeat([part.look.colour for part in parts], sizes, axis=0).astype(np.float32),
        np.repeat([row[part.look] for part in parts], sizes).astype(np.int32),
        np.array([look.texture() for look in row], dtype=np.float32),
    )


def face_normals(triangles: Array) -> Array:
    """Normals (F, 3) of triangles (F, 3, 3), as long as twice their areas."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _normals(
    vertices: Array, faces: NDArray[np.int64], smooth: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Unit normals (F, 3, 3) of corners: of the face, or the mean about the vertex if smooth."""
    flat = face_normals(vertices[faces])
    corners = np.repeat(flat[:, None], 3, axis=1)
    summed = np.zeros_like(vertices)
    np.add.at(summed, faces[smooth], corners[smooth])
    corners[smooth] = summed[faces[smooth]]
    length = np.linalg.norm(corners, axis=-1, keepdims=True)
    return (corners / np.maximum(length, 1e-15)).astype(np.float32)


def _fan(ring: NDArray[np.int64]) -> NDArray[np.int64]:
    first = np.full(len(ring) - 2, ring[0])
    return np.stack([first, ring[1:-1], ring[2:]], axis=-1)


def _perpendicular(direction: Array) -> Array:
    axis = np.eye(3)[np.argmin(np.abs(direction))]
    return np.cross(direction, axis)
