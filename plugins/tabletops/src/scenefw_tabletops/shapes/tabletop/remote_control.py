"""Remote controls: a long case with rows of buttons, a ring of arrows and coloured keys."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Look, Part


def remote_control(rng: np.random.Generator) -> list[Part]:
    """A remote control along x, 12..22 cm long, buttons up."""
    length = rng.uniform(0.12, 0.22)
    width = min(length * rng.uniform(0.22, 0.36), 0.06)
    height = rng.uniform(0.013, 0.026)
    body = colours.plastic(rng)
    radius = width * rng.choice([0.12, 0.25, 0.49])
    case = _case(rng, length, width, height, radius, colours.device(rng, body))
    ink = Look(colours.contrast(body, rng), gloss=0.1)
    keys = Look(colours.shade(body, rng.choice([0.45, 1.8])), gloss=0.2)
    if float(np.mean(keys.colour)) < 0.01 or rng.random() < 0.4:  # else hardly seen on the case
        keys = Look(colours.shade(ink.colour, 0.6), gloss=0.2)
    panel = _Panel(rng, length, width, height, max(0.011, 0.75 * radius), keys, ink)
    return [*case, *panel.parts()]


def _case(
    rng: np.random.Generator, length: float, width: float, height: float, radius: float, look: Look
) -> list[Part]:
    outline = parts.rounded(length, width, radius, 5)
    waist = rng.uniform(0.0, 0.15) * rng.integers(0, 2)  # narrower in the middle, held there
    outline[:, 1] *= 1 - waist * np.cos(np.pi * outline[:, 0] / length) ** 2
    pieces = [parts.plate(outline, 0.0, height, look, bevel=rng.uniform(0.001, 0.004))]
    if rng.random() < 0.5:  # a front plate of another colour
        face = Look(colours.shade(look.colour, rng.choice([0.5, 1.6])), gloss=0.3)
        inner = parts.shrunk(outline, 0.0045)
        pieces.append(parts.plate(inner, height - 0.002, height + 0.0003, face))
    nose = Look(colours.hsv(0.0, 0.5, 0.12), gloss=0.6)
    pieces.append(parts.box((0.002, width * 0.4, height * 0.4), (length / 2, 0, height / 2), nose))
    return pieces


class _Panel:
    """Lays out groups of buttons from the front end to the rear one."""

    def __init__(
        self,
        rng: np.random.Generator,
        length: float,
        width: float,
        height: float,
        start: float,
        keys: Look,
        ink: Look,
    ) -> None:
        self.rng, self.height, self.keys, self.ink = rng, height + 0.0003, keys, ink
        self.half, self.room = length / 2, width - 0.012
        self.columns = int(rng.choice([3, 3, 4]))
        self.pitch = self.room / self.columns
        self.row = self.pitch * rng.uniform(0.7, 1.0)
        self.round = bool(rng.random() < 0.4)
        self.rise = rng.uniform(0.001, 0.003)
        self.offset = start

    def parts(self) -> Iterator[Part]:
        """All buttons."""
        end = 2 * self.half - 0.012 - self.rng.uniform(0.0, 0.35) * 2 * self.half
        groups = [self._arrows, self._numbers, self._colours, self._rockers]
        yield from self._power()
        for number in self.rng.permutation(len(groups)):
            group = groups[number]
            if self.offset < end - self.pitch:
                yield from (part for part in group() if self._fits(part))
        while self.offset < end - self.row:
            yield from (part for part in self._buttons(1) if self._fits(part))

    def _fits(self, part: Part) -> bool:
        return bool(part.vertices[:, 0].min() > 0.005 - self.half)

    def _x(self) -> float:
        return self.half - self.offset

    def _button(
        self, x: float, y: float, width: float, depth: float, look: Look, rise: float = 0.0
    ) -> Part:
        outline = parts.ellipse(width, depth, 10) if self.round else parts.rounded(
            width, depth, 0.25 * min(width, depth), 3
        )  # fmt: skip
        top = self.height + (rise or self.rise)
        return parts.plate(outline + [x, y], self.height - 0.001, top, look, bevel=0.0004)

    def _mark(self, x: float, y: float, width: float, depth: float, rise: float = 0.0) -> Part:
        top = self.height + (rise or self.rise) + 0.00025
        outline = parts.rectangle(width, depth) + [x, y]
        return parts.plate(outline, top - 0.0005, top, self.ink)

    def _power(self) -> Iterator[Part]:
        red = Look(colours.hsv(0.0, 0.85, 0.8), gloss=0.2)
        side = self.rng.choice([-1, 1]) * (self.room / 2 - self.pitch / 2)
        size = 0.75 * min(self.pitch, 0.012)
        yield self._button(self._x(), side, size, size, red)
        self.offset += self.row

    def _buttons(self, rows: int) -> Iterator[Part]:
        for _ in range(rows):
            self.offset += self.row / 2
            for column in range(self.columns):
                y = (column - (self.columns - 1) / 2) * self.pitch
                wide, deep = 0.62 * self.row, 0.7 * self.pitch
                yield self._button(self._x(), y, wide, deep, self.keys)
                yield self._mark(self._x(), y, 0.3 * wide, 0.3 * deep)
            self.offset += self.row / 2

    def _numbers(self) -> Iterator[Part]:
        yield from self._buttons(4)
        self.offset += 0.004

    def _colours(self) -> Iterator[Part]:
        self.offset += 0.5 * self.row
        for place, hue in enumerate((0.0, 0.35, 0.15, 0.62)):
            look = Look(colours.hsv(hue, 0.85, 0.75), gloss=0.2)
            y = (place - 1.5) * self.room / 4
            yield self._button(self._x(), y, 0.4 * self.row, 0.7 * self.room / 4, look)
        self.offset += 0.6 * self.row

    def _arrows(self) -> Iterator[Part]:
        size = min(self.room, 0.038) * self.rng.uniform(0.75, 0.98)
        self.offset += size / 2 + 0.002
        x, top = self._x(), self.height + self.rise
        ring = parts.ellipse(size, size, 24) + [x, 0]
        yield parts.plate(ring, self.height - 0.001, top, self.keys, bevel=0.0006)
        middle = parts.ellipse(0.42 * size, 0.42 * size, 16) + [x, 0]
        yield parts.plate(middle, self.height, top + 0.0006, self.ink, bevel=0.0004)
        for turn in np.arange(4) * np.pi / 2:
            place = 0.36 * size * np.array([np.cos(turn), np.sin(turn)])
            yield self._mark(x + place[0], place[1], 0.08 * size, 0.08 * size)
        self.offset += size / 2 + 0.004

    def _rockers(self) -> Iterator[Part]:
        long = 0.02 * self.rng.uniform(0.8, 1.3)
        self.offset += long / 2 + 0.002
        for side in (-1, 1):
            y = side * (self.room / 2 - self.pitch / 2)
            yield self._button(self._x(), y, long, 0.6 * self.pitch, self.keys, 1.4 * self.rise)
            for end in (-1, 1):
                x = self._x() + end * 0.3 * long
                yield self._mark(x, y, 0.12 * long, 0.12 * long, 1.4 * self.rise)
        self.offset += long / 2 + 0.003
