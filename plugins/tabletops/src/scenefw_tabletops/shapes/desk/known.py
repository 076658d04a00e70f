"""The nine classes in sizes and colours that overlap with each other and with other things."""

from __future__ import annotations

from itertools import product

import numpy as np

from scenefw.core.tabletop import PRINT, STRIPES
from scenefw_tabletops.shapes.desk import paint
from scenefw_tabletops.shapes.tabletop import book as easy_book
from scenefw_tabletops.shapes.tabletop import coin as easy_coin
from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop import keyboard as easy_keyboard
from scenefw_tabletops.shapes.tabletop import model_plane as easy_plane
from scenefw_tabletops.shapes.tabletop import pen as easy_pen
from scenefw_tabletops.shapes.tabletop import remote_control as easy_remote
from scenefw_tabletops.shapes.tabletop import wires as easy_wires
from scenefw_tabletops.shapes.tabletop.keyboard import Keys
from scenefw_tabletops.shapes.tabletop.parts import Look, Part


def remote_control(rng: np.random.Generator) -> list[Part]:
    """A remote control of 8..27 cm, 6..28 mm thick."""
    pieces = paint.repainted(easy_remote.remote_control(rng), rng)
    length = rng.uniform(0.08, 0.27)
    width = float(np.clip(length * rng.uniform(0.2, 0.45), 0.026, 0.075))
    return paint.sized(pieces, (length, width, rng.uniform(0.007, 0.028)))


def keyboard(rng: np.random.Generator) -> list[Part]:
    """A keyboard of any size: full, small, of 60 per cent, or a block of digits."""
    kind = rng.choice(3, p=[0.4, 0.35, 0.25])
    if kind == 0:
        pieces = easy_keyboard.keyboard(rng)
        factor = rng.uniform(0.5, 1.0)
        vertices = np.concatenate([part.vertices for part in pieces])
        length, width = factor * np.ptp(vertices[:, :2], axis=0)
        pieces = paint.sized(pieces, (length, width, rng.uniform(0.007, 0.03)))
    else:
        pieces = _pad(rng, digits=bool(kind == 2))
    return paint.repainted(pieces, rng)


def _pad(rng: np.random.Generator, *, digits: bool) -> list[Part]:
    pitch = rng.uniform(0.0095, 0.0195)
    units, rows = (4, 5) if digits else (15, int(rng.integers(4, 6)))
    margin, height = rng.uniform(0.003, 0.012), rng.uniform(0.005, 0.02)
    size = (units * pitch + 2 * margin, rows * pitch + 2 * margin, height)
    body = colours.plastic(rng)
    keys = Keys(rng, pitch, height, body)
    low = -size[0] / 2 + margin, -size[1] / 2 + margin
    tops = keys.numbers(*low) if digits else keys.main(*low, rows)
    case = paint.slab(rng, size, colours.device(rng, body), rng.uniform(0.01, 0.1))
    return [case, *tops]


def model_plane(rng: np.random.Generator) -> list[Part]:
    """A model plane of 5..32 cm."""
    pieces = paint.repainted(easy_plane.model_plane(rng), rng, share=0.5)
    length = float(rng.choice([rng.uniform(0.05, 0.14), rng.uniform(0.12, 0.32)]))
    vertices = np.concatenate([part.vertices for part in pieces])
    factor = length / np.ptp(vertices[:, 0])
    return [
        part.turned(np.diag([factor, factor, factor * rng.uniform(0.7, 1.1)])) for part in pieces
    ]


def coin(rng: np.random.Generator) -> list[Part]:
    """A coin of 15..34 mm, 1.5..2.6 mm thick."""
    pieces = paint.repainted(easy_coin.coin(rng), rng, share=0.3, small=0.1)
    size = rng.uniform(0.015, 0.034)
    return paint.sized(pieces, (size, size, rng.uniform(0.0015, 0.0026)))


def pen(rng: np.random.Generator) -> list[Part]:
    """A pen, pencil, marker or stub of 6..19 cm, 5..20 mm thick."""
    pieces = paint.repainted(easy_pen.pen(rng), rng)
    thick = float(rng.choice([rng.uniform(0.005, 0.011), rng.uniform(0.01, 0.02)], p=[0.7, 0.3]))
    return paint.sized(pieces, (rng.uniform(0.06, 0.19), thick, thick))


def brick(rng: np.random.Generator) -> list[Part]:
    """A toy brick with 1 x 1 to 8 x 4 studs that are 7.5..17 mm apart."""
    across, deep = int(rng.integers(1, 9)), int(rng.integers(1, 5))
    pitch = rng.uniform(0.0075, 0.017 if across * deep <= 12 else 0.011)
    height = pitch * rng.choice([rng.uniform(1.0, 1.4), rng.uniform(0.35, 0.5)], p=[0.7, 0.3])
    skin = paint.look(rng) if rng.random() < 0.35 else paint.plain(rng)
    pieces = [
        parts.box((across * pitch, deep * pitch, height), (0, 0, height / 2), skin, 0.0004),
    ]
    wide = rng.uniform(0.5, 0.68) * pitch
    stud = parts.ellipse(wide, wide, 10)
    rise = rng.uniform(0.15, 0.25) * pitch
    for column, row in product(range(across), range(deep)):
        place = (np.array([column, row]) - [(across - 1) / 2, (deep - 1) / 2]) * pitch
        pieces.append(parts.plate(stud + place, height - 0.001, height + rise, skin))
    return pieces


def paperclip(rng: np.random.Generator) -> list[Part]:
    """A paperclip of 2..7 cm, wire of 0.8..1.6 mm."""
    pieces = paint.repainted(easy_wires.paperclip(rng), rng, share=0.3)
    length = rng.uniform(0.022, 0.07)
    return paint.sized(
        pieces, (length, length * rng.uniform(0.2, 0.3), rng.uniform(0.0008, 0.0016))
    )


def book(rng: np.random.Generator) -> list[Part]:
    """A book, booklet or notebook of 8..28 cm, 3..50 mm thick."""
    length = rng.uniform(0.08, 0.28)
    width = length * rng.uniform(0.55, 0.85)
    height = float(rng.choice([rng.uniform(0.003, 0.012), rng.uniform(0.01, 0.05)]))
    pieces = _notebook(rng) if rng.random() < 0.3 else easy_book.book(rng)
    return paint.sized(paint.repainted(pieces, rng, share=0.6), (length, width, height))


def _notebook(rng: np.random.Generator) -> list[Part]:
    """Pages between covers on a spiral, closed or open at a printed page."""
    length, width, height = 0.2, 0.14, 0.012
    ink = colours.grey(rng.uniform(0.1, 0.4))
    page = Look(colours.grey(0.92), PRINT, rng.uniform(0.005, 0.009), 0.9, 0.0, ink)
    cover = page if rng.random() < 0.35 else paint.look(rng)
    edge = Look(colours.grey(0.88), STRIPES, 0.0012, 0.4, np.pi / 2, colours.grey(0.6))
    pieces = [
        parts.box((length, width, 0.001), (0, 0, 0.0005), paint.plain(rng)),
        parts.box((length - 0.002, width - 0.002, height - 0.002), (0, 0, height / 2), edge),
        parts.box((length, width, 0.001), (0, 0, height - 0.0005), cover),
    ]
    wire = Look(colours.metal(rng), gloss=0.6)
    for x in np.arange(-0.48, 0.481, 0.06) * length:
        loop = parts.lathe([[-0.0012, 0.0065], [0.0012, 0.0065]], wire, 8)
        pieces.append(loop.moved([x, -width / 2, height / 2]))
    return pieces
