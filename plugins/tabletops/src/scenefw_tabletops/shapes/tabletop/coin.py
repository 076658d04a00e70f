"""Coins: a disc with a rim, a ring of another metal perhaps, and a relief."""

from __future__ import annotations

import numpy as np

from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Look, Part


def coin(rng: np.random.Generator) -> list[Part]:
    """A coin of 18..32 mm, 1.8..3.2 mm thick."""
    size, height = rng.uniform(0.018, 0.032), rng.uniform(0.0018, 0.0032)
    outer = Look(colours.metal(rng), gloss=rng.uniform(0.3, 0.7))
    inner = outer if rng.random() < 0.6 else Look(colours.metal(rng), gloss=0.5)
    sides = int(rng.choice([7, 12, 40], p=[0.1, 0.1, 0.8]))
    disc = parts.ellipse(size, size, sides)
    pieces = [
        parts.plate(disc, 0.0, height, outer, bevel=0.0003),
        parts.plate(0.86 * disc, 0.0, height + 0.0001, Look(colours.shade(outer.colour, 0.75))),
        parts.plate(parts.ellipse(0.68 * size, 0.68 * size, 32), 0.0, height + 0.0002, inner),
    ]
    relief = Look(colours.shade(inner.colour, 0.6), gloss=0.5)
    top = height + 0.0005
    for _ in range(int(rng.integers(2, 5))):
        width, depth = rng.uniform(0.08, 0.35, 2) * size
        turn = rng.uniform(0, np.pi)
        c, s = np.cos(turn), np.sin(turn)
        mark = parts.ellipse(width, depth, 12) + rng.uniform(-0.13, 0.13, 2) * size
        pieces.append(parts.plate(mark @ [[c, s], [-s, c]], height, top, relief))
    for angle in np.arange(0, 2 * np.pi, rng.uniform(0.3, 0.8)):
        dot = parts.ellipse(0.04 * size, 0.04 * size, 6)
        place = 0.39 * size * np.array([np.cos(angle), np.sin(angle)])
        pieces.append(parts.plate(dot + place, height, top, outer))
    return pieces
