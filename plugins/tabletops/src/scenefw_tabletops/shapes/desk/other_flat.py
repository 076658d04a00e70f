"""Flat things without a class: phones, calculators, laptops, boxes, sheets, cards, sponges."""

from __future__ import annotations

import numpy as np

from scenefw.core.tabletop import NOISE, PLAIN, PRINT, SPECKLE, STRIPES
from scenefw_tabletops.shapes.desk import paint
from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Look, Part


def phone(rng: np.random.Generator) -> list[Part]:
    """A phone or player of 9..18 cm, face up or down."""
    length = rng.uniform(0.09, 0.18)
    width, height = length * rng.uniform(0.4, 0.52), rng.uniform(0.006, 0.014)
    corner = rng.uniform(0.05, 0.2)
    pieces = [paint.slab(rng, (length, width, height), paint.look(rng), corner)]
    if rng.random() < 0.6:
        glass = Look(colours.hsv(rng.random(), 0.3, rng.uniform(0.03, 0.3)), gloss=0.7)
        if rng.random() < 0.3:  # it is on
            glass = Look(paint.colour(rng), PRINT, 0.005, 0.7, 0.0, paint.colour(rng), 0.6)
        inner = parts.rounded(0.93 * length, 0.9 * width, corner * width, 4)
        return [*pieces, paint.upon(inner, height, glass)]
    eye = Look(colours.grey(0.05), gloss=0.7)
    for x in np.arange(rng.integers(1, 4)) * 0.014:
        lens = parts.ellipse(0.011, 0.011, 12) + [0.42 * length - x, 0.3 * width]
        pieces.append(paint.upon(lens, height, eye, 0.0015))
    return pieces


def calculator(rng: np.random.Generator) -> list[Part]:
    """A calculator or meter of 8..19 cm with a window and a grid of buttons."""
    length = rng.uniform(0.08, 0.19)
    width, height = length * rng.uniform(0.4, 0.75), rng.uniform(0.006, 0.024)
    pieces = [paint.slab(rng, (length, width, height), paint.look(rng), rng.uniform(0, 0.2))]
    window = rng.uniform(0.15, 0.4)
    glass = Look(colours.hsv(rng.uniform(0.2, 0.4), 0.2, rng.uniform(0.2, 0.6)), gloss=0.5)
    screen = parts.rectangle(window * length * 0.7, 0.85 * width)
    pieces.append(paint.upon(screen + [(0.5 - window / 2) * length, 0], height, glass))
    return pieces + _buttons(rng, length * (0.94 - window), width, height, -0.47 * length)


def _buttons(
    rng: np.random.Generator, length: float, width: float, height: float, start: float
) -> list[Part]:
    columns, rows = int(rng.integers(3, 6)), int(rng.integers(4, 7))
    rise, fill = rng.uniform(0.0008, 0.003), rng.uniform(0.6, 0.85)
    skins = [paint.plain(rng) for _ in range(3)]
    round_ = rng.random() < 0.3
    pieces = []
    for row in range(rows):
        for column in range(columns):
            deep, wide = length / rows, 0.94 * width / columns
            place = [start + (row + 0.5) * deep, (column + 0.5) * wide - 0.47 * width]
            skin = skins[int(column == columns - 1) + int(row == 0 and column == 0)]
            outline = parts.rectangle(fill * deep, fill * wide)
            if round_:
                outline = parts.ellipse(fill * deep, fill * wide, 10)
            pieces.append(paint.upon(outline + place, height, skin, rise))
    return pieces


def laptop(rng: np.random.Generator) -> list[Part]:
    """A closed small laptop or a tablet of 18..32 cm."""
    length = rng.uniform(0.18, 0.32)
    width, height = length * rng.uniform(0.6, 0.75), rng.uniform(0.007, 0.024)
    corner = rng.uniform(0.02, 0.08)
    pieces = [paint.slab(rng, (length, width, height), paint.look(rng), corner)]
    if rng.random() < 0.5:
        face = parts.rounded(0.93 * length, 0.9 * width, 0.005, 4)
        glass = Look(colours.grey(rng.uniform(0.03, 0.2)), gloss=0.7)
        return [*pieces, paint.upon(face, height, glass)]
    size = rng.uniform(0.02, 0.05)
    return [*pieces, paint.upon(parts.ellipse(size, size, 20), height, paint.plain(rng))]


def box(rng: np.random.Generator) -> list[Part]:
    """A carton or case with sides of 2..24 cm, up to 6 cm high, with a label perhaps."""
    length = rng.uniform(0.04, 0.24)
    width, height = length * rng.uniform(0.3, 0.95), rng.uniform(0.008, 0.06)
    pieces = [paint.slab(rng, (length, width, height), paint.look(rng))]
    if rng.random() < 0.6:
        size = rng.uniform(0.4, 0.9, 2) * [length, width]
        pieces.append(paint.upon(parts.rectangle(*size), height, paint.look(rng)))
    if rng.random() < 0.4:
        strip = parts.rectangle(length, width * rng.uniform(0.08, 0.25))
        pieces.append(paint.upon(strip, height, paint.plain(rng), 0.0005))
    return pieces


def pencil_case(rng: np.random.Generator) -> list[Part]:
    """A pencil case of 14..24 cm with a zip; its sides bulge."""
    length = rng.uniform(0.14, 0.24)
    width, height = length * rng.uniform(0.2, 0.45), rng.uniform(0.012, 0.045)
    levels = [(0.0, 0.97), (0.3, 1.0), (0.7, 0.98), (0.93, 0.85), (1.0, 0.6)]
    outline = parts.rounded(length, width, 0.3 * width, 5)
    rings = [np.column_stack([s * outline, np.full(len(outline), h * height)]) for h, s in levels]
    zipper = Look(colours.metal(rng), STRIPES, 0.002, 0.8, 0.0, colours.grey(0.2), 0.4)
    strip = parts.rectangle(0.56 * length, 0.006) + [0, rng.uniform(-0.15, 0.15) * width]
    pull = parts.rectangle(0.018, 0.005) + [0.25 * length, 0]
    return [
        parts.loft(rings, paint.look(rng), smooth=True),
        paint.upon(strip, height, zipper, 0.0008),
        paint.upon(pull, height, paint.plain(rng), 0.002),
    ]


def sheet(rng: np.random.Generator) -> list[Part]:
    """A page, leaflet or photograph of 10..30 cm, 0.3 mm thick."""
    length = rng.uniform(0.10, 0.297)
    return _paper(rng, length, length * rng.uniform(0.6, 0.8), 0.0003)


def card(rng: np.random.Generator) -> list[Part]:
    """A card, ticket or note of 5..12 cm, up to 1 mm thick."""
    length = rng.uniform(0.05, 0.12)
    return _paper(rng, length, length * rng.uniform(0.5, 1.0), rng.uniform(0.0003, 0.001))


def _paper(rng: np.random.Generator, length: float, width: float, height: float) -> list[Part]:
    paper = colours.hsv(rng.random(), rng.uniform(0, 0.12), rng.uniform(0.8, 0.97))
    if rng.random() < 0.3:
        paper = paint.colour(rng)
    ink = colours.contrast(paper, rng)
    kind = int(rng.choice([PRINT, PLAIN, STRIPES], p=[0.7, 0.2, 0.1]))
    turn = rng.choice([0.0, np.pi / 2])
    skin = Look(paper, kind, rng.uniform(0.0035, 0.009), rng.uniform(0.5, 0.95), turn, ink)
    return [parts.plate(parts.rectangle(length, width), 0.0, height, skin)]


def pad(rng: np.random.Generator) -> list[Part]:
    """A mouse mat or desk mat of 16..34 cm, 1..4 mm thick."""
    length = rng.uniform(0.16, 0.34)
    size = (length, length * rng.uniform(0.6, 1.0), rng.uniform(0.001, 0.004))
    return [paint.slab(rng, size, paint.look(rng), rng.uniform(0, 0.08))]


def sponge(rng: np.random.Generator) -> list[Part]:
    """A sponge or rubber of 3..13 cm, in two layers perhaps."""
    length = rng.uniform(0.03, 0.13)
    width, height = length * rng.uniform(0.4, 0.8), min(0.4 * length, rng.uniform(0.01, 0.04))
    first = paint.colour(rng)
    skin = Look(first, SPECKLE, rng.uniform(0.003, 0.006), 0.7, 0.0, colours.shade(first, 0.55))
    low = rng.uniform(0.5, 0.9) * height
    outline = parts.rounded(length, width, rng.uniform(0.02, 0.2) * width, 4)
    top = Look(paint.colour(rng), NOISE, 0.004, 0.6, 0.0, paint.colour(rng))
    return [
        parts.plate(outline, 0.0, low, skin),
        parts.plate(outline, low, height, top, 0.001),
    ]


def organiser(rng: np.random.Generator) -> list[Part]:
    """A panel of 8..30 cm with rows of buttons, sockets or pills, like a keyboard or remote."""
    length = rng.uniform(0.08, 0.30)
    width, height = min(0.14, length * rng.uniform(0.18, 0.45)), rng.uniform(0.006, 0.03)
    pieces = [paint.slab(rng, (length, width, height), paint.look(rng), rng.uniform(0, 0.3))]
    rows = int(rng.integers(1, 4))
    columns = int(rng.integers(3, 11))
    deep, wide = 0.92 * length / columns, 0.9 * width / rows
    rise = rng.choice([rng.uniform(0.0005, 0.001), rng.uniform(0.002, 0.006)])
    skin, ink = paint.look(rng), paint.plain(rng)
    fill = rng.uniform(0.6, 0.85)
    for column, row in np.ndindex(columns, rows):
        place = [(column + 0.5) * deep - 0.46 * length, (row + 0.5) * wide - 0.45 * width]
        outline = parts.rounded(fill * deep, fill * wide, 0.3 * fill * min(deep, wide), 3)
        pieces.append(paint.upon(outline + place, height, skin, rise))
        mark = parts.rectangle(0.3 * fill * deep, 0.3 * fill * wide)
        pieces.append(paint.upon(mark + place, height + rise, ink))
    return pieces
