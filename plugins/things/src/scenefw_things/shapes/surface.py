"""Triangles of a thing with looks: all sides of all its parts, hidden ones too.

Rays meet the outermost side first, so that images are those of the union, which takes a hundred
times as long to compute.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenefw.core.tabletop import DOTS, NOISE, PLAIN, PRINT, SPECKLE, STRIPES, WOOD
from scenefw.core.types import Float64
from scenefw.shapes.hulls import hull_mesh
from scenefw_tabletops.shapes.desk import paint
from scenefw_tabletops.shapes.tabletop import colours
from scenefw_tabletops.shapes.tabletop.parts import Look
from scenefw_things.shapes.solids import Part

_KINDS = (PLAIN, NOISE, SPECKLE, STRIPES, WOOD, DOTS, PRINT)
_SHARES = (0.4, 0.14, 0.06, 0.12, 0.1, 0.06, 0.12)
_ALIKE = 0.25  # chance that another paint is the first one
_CORNER_DIGITS = 9  # m: corners that are equal so far belong to one


class Surface(NamedTuple):
    """Triangles with paints.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3), counter-clockwise from outside.
        paints: (F,) number of the paint of each face.
    """

    vertices: Float64
    faces: NDArray[np.int64]
    paints: NDArray[np.int64]


def surface(parts: Sequence[Part]) -> Surface:
    """The sides of all parts, corners that parts share joined."""
    meshes = [hull_mesh(part.corners) for part in parts]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate(
        [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    )
    paints = np.repeat([part.paint for part in parts], [len(mesh.faces) for mesh in meshes])
    _, first, index = np.unique(
        vertices.round(_CORNER_DIGITS), axis=0, return_index=True, return_inverse=True
    )
    return Surface(vertices[first], index.ravel()[faces], paints)


def looks(rng: np.random.Generator, count: int) -> list[Look]:
    """Looks of the paints of one thing: plain, printed, graded, wooden, striped, dull to shiny."""
    drawn: list[Look] = []
    for number in range(count):
        if number and rng.random() < _ALIKE:
            drawn.append(drawn[0])
        else:
            drawn.append(_look(rng, plain=number > 1))
    return drawn


def _look(rng: np.random.Generator, *, plain: bool) -> Look:
    first = paint.colour(rng)
    kind = PLAIN if plain else int(rng.choice(_KINDS, p=_SHARES))
    second = paint.colour(rng) if rng.random() < 0.5 else colours.contrast(first, rng)
    periods = {PRINT: (0.003, 0.008), SPECKLE: (0.002, 0.006), NOISE: (0.03, 0.3)}
    period = rng.uniform(*periods.get(kind, (0.006, 0.04)))
    gloss = rng.choice([0.0, rng.uniform(0.05, 0.35), rng.uniform(0.4, 0.9)], p=[0.35, 0.4, 0.25])
    return Look(first, kind, period, rng.uniform(0.3, 1.0), rng.uniform(0, np.pi), second, gloss)
