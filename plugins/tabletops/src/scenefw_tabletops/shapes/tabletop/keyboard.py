"""Keyboards: a flat case with five or six staggered rows of keys, arrows and number blocks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Look, Part

# Widths of the keys of a row in units of one key; each row is 15 units wide.
_ROWS = (
    (1.5, 1.25, 1.25, 5.75, 1.25, 1.25, 1.25, 1.5),
    (2.25, *[1.0] * 10, 2.75),
    (1.75, *[1.0] * 11, 2.25),
    (1.5, *[1.0] * 12, 1.5),
    (*[1.0] * 13, 2.0),
    (1.22, *[1.06] * 13),
)


def keyboard(rng: np.random.Generator) -> list[Part]:
    """A keyboard along x, 25..45 cm wide, the space bar towards -y."""
    blocks = int(rng.choice(3, p=[0.4, 0.25, 0.35]))  # none, arrows, arrows and numbers
    units = 15.0 + (0.0, 3.4, 7.7)[blocks]
    pitch = rng.uniform(0.0162, 0.0192) if blocks else rng.uniform(0.0162, 0.021)
    rows = int(rng.choice([5, 6, 6]))
    margin = rng.uniform(0.004, 0.014)
    shelf = rng.choice([0.0, rng.uniform(0.02, 0.05)], p=[0.75, 0.25])  # where the wrists rest
    brow = rng.choice([0.0, rng.uniform(0.008, 0.025)], p=[0.6, 0.4])
    size = (units * pitch + 2 * margin, rows * pitch + 2 * margin + shelf + brow)
    height = rng.uniform(0.008, 0.018)
    body = colours.plastic(rng)
    look = colours.device(rng, body)
    radius = rng.uniform(0.003, 0.012)
    bevel = min(rng.uniform(0.001, 0.004), 0.4 * height)
    pieces = [parts.plate(parts.rounded(*size, radius), 0.0, height, look, bevel)]
    left, low = -size[0] / 2 + margin, -size[1] / 2 + margin + shelf
    tops = Keys(rng, pitch, height, body)
    pieces += tops.main(left, low, rows)
    if blocks >= 1:
        pieces += tops.arrows(left + 15.2 * pitch, low, rows)
    if blocks == 2:
        pieces += tops.numbers(left + 18.6 * pitch, low)
    if brow:
        pieces += _lamps(rng, size, height, brow + margin)
    slope = np.tan(np.deg2rad(rng.uniform(0, 6)))
    return [_tilted(part, slope, -size[1] / 2) for part in pieces]


class Keys:
    """Key caps of one style."""

    def __init__(
        self, rng: np.random.Generator, pitch: float, height: float, body: parts.Colour
    ) -> None:
        self.pitch, self.height = pitch, height
        cap = body if rng.random() < 0.3 else colours.plastic(rng)
        self.letters = Look(cap, gloss=rng.uniform(0, 0.25))
        self.modifiers = self.letters
        if rng.random() < 0.4:
            self.modifiers = Look(colours.shade(cap, rng.choice([0.5, 1.7])), gloss=0.1)
        self.ink = Look(colours.contrast(cap, rng))
        self.rise = rng.choice([rng.uniform(0.0015, 0.003), rng.uniform(0.004, 0.008)])
        self.gap = rng.uniform(0.0015, 0.0035)
        self.taper = min(0.0025, 0.4 * self.rise)
        self.accent = Look(colours.vivid(rng)) if rng.random() < 0.25 else self.modifiers

    def main(self, left: float, low: float, rows: int) -> Iterator[Part]:
        """The letters, space bar and function keys."""
        for row, widths in enumerate(_ROWS[:rows]):
            x = left
            for number, width in enumerate(widths):
                letter = width == 1.0
                look = self.letters if letter or width > 5 else self.modifiers
                if (row, number) in ((rows - 1, 0), (2, len(widths) - 1)):  # escape and return
                    look = self.accent
                yield from self._key(x, low + row * self.pitch, width, look, marked=width < 5)
                x += width * self.pitch

    def arrows(self, left: float, low: float, rows: int) -> Iterator[Part]:
        """Arrow keys in a T and the block above them."""
        for column, row in ((0, 0), (1, 0), (2, 0), (1, 1)):
            yield from self._place(left, low, column, row)
        for row in range(3, rows):
            for column in range(3):
                yield from self._place(left, low, column, row)

    def numbers(self, left: float, low: float) -> Iterator[Part]:
        """The block of digits."""
        for row in range(5):
            for column in range(4):
                yield from self._place(left, low, column, row)

    def _place(self, left: float, low: float, column: int, row: int) -> Iterator[Part]:
        x, y = left + column * self.pitch, low + row * self.pitch
        yield from self._key(x, y, 1.0, self.modifiers, marked=True)

    def _key(self, x: float, y: float, width: float, look: Look, *, marked: bool) -> Iterator[Part]:
        size = (width * self.pitch - self.gap, self.pitch - self.gap)
        middle = np.array([x + width * self.pitch / 2, y + self.pitch / 2])
        top = self.height + self.rise
        outline = parts.rectangle(*size) + middle
        upper = parts.shrunk(outline, self.taper)
        rings = [
            np.column_stack([outline, np.full(4, self.height - 0.0005)]),
            np.column_stack([upper, np.full(4, top)]),
        ]
        yield parts.loft(rings, look)
        if marked:
            mark = parts.rectangle(0.22 * self.pitch, 0.26 * self.pitch)
            place = middle + [-0.12 * self.pitch, 0.1 * self.pitch]
            yield parts.plate(mark + place, top - 0.0002, top + 0.00025, self.ink)


def _lamps(
    rng: np.random.Generator, size: tuple[float, float], height: float, brow: float
) -> list[Part]:
    light = Look(colours.hsv(rng.choice([0.33, 0.6, 0.0]), 0.7, 0.95))
    y = size[1] / 2 - brow / 2
    start = size[0] / 2 - rng.uniform(0.03, 0.06)
    return [
        parts.box((0.004, 0.002, 0.001), (start - 0.01 * i, y, height), light) for i in range(3)
    ]


def _tilted(part: Part, slope: float, front: float) -> Part:
    """Higher at the back, with the bottom left on the table."""
    vertices = part.vertices.copy()
    vertices[:, 2] += np.where(vertices[:, 2] > 1e-9, slope * (vertices[:, 1] - front), 0)
    return replace(part, vertices=vertices)
