"""Toy bricks with studs."""

from __future__ import annotations

from itertools import product

import numpy as np

from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Look, Part

_SIZES = ((2, 2), (3, 2), (4, 2), (6, 2), (8, 2), (4, 1), (2, 1), (4, 4), (3, 3))


def brick(rng: np.random.Generator) -> list[Part]:
    """A brick of 16..64 mm with one stud per 8 mm, or twice as large with one per 16 mm."""
    across, deep = _SIZES[rng.integers(len(_SIZES))]
    pitch = 0.016 if across * deep <= 8 and rng.random() < 0.4 else 0.008
    height = pitch * rng.choice([1.2, 0.4], p=[0.8, 0.2])
    look = Look(colours.vivid(rng), gloss=rng.uniform(0.1, 0.5))
    if rng.random() < 0.2:
        look = Look(colours.grey(rng.choice([0.2, 0.55, 0.9])), gloss=0.3)
    pieces = [parts.box((across * pitch, deep * pitch, height), (0, 0, height / 2), look, 0.0004)]
    stud = parts.ellipse(0.6 * pitch, 0.6 * pitch, 14)
    for column, row in product(range(across), range(deep)):
        place = (np.array([column, row]) - [(across - 1) / 2, (deep - 1) / 2]) * pitch
        pieces.append(
            parts.plate(stud + place, height - 0.001, height + 0.22 * pitch, look, 0.0003)
        )
    return pieces
