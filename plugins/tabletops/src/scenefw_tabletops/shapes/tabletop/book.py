"""Books: two covers and a spine about a block of pages, with a title and a picture."""

from __future__ import annotations

import numpy as np

from scenefw.core.tabletop import STRIPES
from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Look, Part


def book(rng: np.random.Generator) -> list[Part]:
    """A closed book, 11..22 cm high along x, 7..16 cm wide, 6..35 mm thick."""
    length = rng.uniform(0.11, 0.22)
    width, height = length * rng.uniform(0.62, 0.78), rng.uniform(0.006, 0.035)
    cover = rng.uniform(0.0008, 0.002)
    edge = rng.uniform(0.001, 0.004)
    colour = colours.vivid(rng) if rng.random() < 0.7 else colours.plastic(rng)
    look = colours.painted(rng, colour, colours.vivid(rng))
    paper = Look(colours.hsv(0.12, 0.12, 0.9), STRIPES, 0.0011, 0.5, np.pi / 2,
                 colours.grey(0.6))  # fmt: skip
    pages = (length - 2 * edge, width - edge - cover, height - 2 * cover)
    pieces = [
        parts.box((length, width, cover), (0, 0, cover / 2), look),
        parts.box((length, width, cover), (0, 0, height - cover / 2), look),
        parts.box((length, cover, height), (0, -width / 2 + cover / 2, height / 2), look),
        parts.box(pages, (0, -edge / 2 + cover / 2, height / 2), paper),
    ]
    return [*pieces, *_print(rng, length, width, height, colour)]


def _print(
    rng: np.random.Generator, length: float, width: float, height: float, colour: parts.Colour
) -> list[Part]:
    """Title in lines, perhaps a picture, on the front cover; up is towards -x."""
    ink = Look(colours.contrast(colour, rng))
    top = height + 0.00025
    y, line = rng.uniform(-0.02, 0.02) * width, rng.uniform(0.035, 0.06) * length
    x = -0.5 * length + rng.uniform(0.1, 0.2) * length
    pieces = []
    for _ in range(int(rng.integers(1, 4))):
        wide = rng.uniform(0.4, 0.78) * width
        letters = int(rng.integers(4, 9))
        for letter in range(letters):
            place = y + ((letter + 0.5) / letters - 0.5) * wide
            glyph = parts.rectangle(line * rng.uniform(0.6, 1.0), 0.6 * wide / letters)
            pieces.append(parts.plate(glyph + [x, place], height - 0.0003, top, ink))
        x += 1.5 * line
    if rng.random() < 0.7:
        picture = colours.painted(rng, colours.vivid(rng), colours.vivid(rng))
        size = rng.uniform(0.25, 0.4) * length, rng.uniform(0.4, 0.75) * width
        at = [0.48 * length - 0.62 * size[0], y]
        shape = parts.ellipse(*size, 24) if rng.random() < 0.4 else parts.rectangle(*size)
        pieces.append(parts.plate(shape + at, height - 0.0003, top, picture))
    return pieces
