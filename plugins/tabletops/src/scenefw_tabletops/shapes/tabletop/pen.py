"""Pens and pencils: a round barrel with a tip, a grip and a cap or a rubber."""

from __future__ import annotations

import numpy as np

from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Look, Part


def pen(rng: np.random.Generator) -> list[Part]:
    """A pen or pencil along x, 12..17 cm long, 7..13 mm thick."""
    length, radius = rng.uniform(0.12, 0.17), rng.uniform(0.0035, 0.0065)
    colour = colours.vivid(rng) if rng.random() < 0.6 else colours.plastic(rng)
    body = colours.painted(rng, colour, colours.contrast(colour, rng))
    pieces = _pencil(length, radius, body) if rng.random() < 0.3 else _ballpoint(
        rng, length, radius, body
    )  # fmt: skip
    turn = rng.uniform(0, 2 * np.pi)
    c, s = np.cos(turn), np.sin(turn)
    return [part.turned([[1, 0, 0], [0, c, -s], [0, s, c]]) for part in pieces]


def _pencil(length: float, radius: float, body: Look) -> list[Part]:
    wood, lead = Look(colours.hsv(0.09, 0.4, 0.85)), Look(colours.grey(0.15))
    half, cone = length / 2, 4.5 * radius
    tin, rubber = Look(colours.grey(0.7), gloss=0.6), Look(colours.hsv(0.97, 0.5, 0.8))
    barrel = parts.lathe([[-half + 0.015, radius], [half - cone, radius]], body, 6)
    return [
        Part(barrel.vertices, barrel.faces, body),
        parts.lathe([[half - cone, radius], [half - cone / 4, radius / 4]], wood, 12),
        parts.lathe([[half - cone / 4, radius / 4], [half, 0.0002]], lead, 8),
        parts.lathe([[-half + 0.008, radius], [-half + 0.016, radius * 1.02]], tin, 12),
        parts.lathe([[-half, 0.8 * radius], [-half + 0.008, 0.9 * radius]], rubber, 12),
    ]


def _ballpoint(rng: np.random.Generator, length: float, radius: float, body: Look) -> list[Part]:
    half, tip = length / 2, rng.uniform(2, 5) * radius
    split = rng.uniform(-0.1, 0.25) * length
    accent = Look(colours.plastic(rng) if rng.random() < 0.5 else colours.vivid(rng), gloss=0.3)
    metal = Look(colours.metal(rng), gloss=0.7)
    wide = radius * rng.uniform(1.02, 1.2)
    pieces = [
        parts.lathe([[split, radius], [half - tip, 0.92 * radius]], body, 16),
        parts.lathe([[-half + 0.004, wide], [split, wide]], accent, 16),
        parts.lathe([[half - tip, 0.9 * radius], [half - 0.003, 0.3 * radius]], metal, 12),
        parts.lathe([[half - 0.003, 0.25 * radius], [half, 0.0003]], metal, 8),
        parts.lathe([[-half, 0.5 * wide], [-half + 0.004, 0.6 * wide]], metal, 12),
    ]
    long = rng.uniform(0.03, 0.045)
    clip = parts.box((long, 0.003, 0.0012), (-half + 0.005 + long / 2, 0, wide + 0.0012), metal)
    foot = parts.box((0.004, 0.003, 0.002), (-half + 0.007, 0, wide + 0.0003), metal)
    return [*pieces, clip, foot]
