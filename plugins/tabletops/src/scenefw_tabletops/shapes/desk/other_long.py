"""Long and branched things without a class: rulers, sticks, tools, crosses, keys, scissors."""

from __future__ import annotations

import numpy as np

from scenefw.core.tabletop import PLAIN, STRIPES, WOOD
from scenefw_tabletops.shapes.desk import paint
from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Look, Part


def ruler(rng: np.random.Generator) -> list[Part]:
    """A ruler or slat of 10..32 cm, 1..5 mm thick."""
    length, width = rng.uniform(0.10, 0.32), rng.uniform(0.012, 0.04)
    high = rng.uniform(0.001, 0.005)
    skin, ink = paint.look(rng), colours.grey(rng.uniform(0, 0.3))
    scale = Look(skin.colour, STRIPES, 0.004, 0.9, 0.0, ink)
    strip = parts.rectangle(0.96 * length, 0.25 * width) + [0, 0.34 * width]
    return [paint.slab(rng, (length, width, high), skin), paint.upon(strip, high, scale, 0.0002)]


def stick(rng: np.random.Generator) -> list[Part]:
    """A wooden stick, chopstick or rod of 7..24 cm, 3..14 mm thick."""
    length, thick = rng.uniform(0.07, 0.24), rng.uniform(0.003, 0.014)
    first = paint.colour(rng)
    kind = WOOD if rng.random() < 0.6 else PLAIN
    skin = Look(first, kind, 0.004, 0.6, 0.0, colours.shade(first, 0.6), rng.uniform(0, 0.4))
    if rng.random() < 0.5:
        end = thick * rng.uniform(0.5, 1.0)
        return [parts.lathe([[-length / 2, thick / 2], [length / 2, end / 2]], skin, 12)]
    return [parts.box((length, thick, thick), (0, 0, thick / 2), skin, 0.0006)]


def tool(rng: np.random.Generator) -> list[Part]:
    """A screwdriver, brush or spoon of 9..22 cm: a handle and a thinner shaft."""
    length, thick = rng.uniform(0.09, 0.22), rng.uniform(0.008, 0.022)
    half, split = length / 2, rng.uniform(-0.15, 0.2) * length
    shaft = paint.plain(rng, colours.metal(rng) if rng.random() < 0.7 else None)
    handle = [[-half, 0.4], [-half + 0.006, 0.5], [split - 0.01, 0.42], [split, 0.25]]
    profile = [[x, r * thick] for x, r in handle]
    pieces = [
        parts.lathe(profile, paint.look(rng), 12),
        parts.lathe([[split, 0.12 * thick], [half, 0.12 * thick]], shaft, 8),
    ]
    if rng.random() < 0.6:
        size = (0.02, thick * rng.uniform(0.4, 1.3), 0.2 * thick)
        pieces.append(parts.box(size, (half, 0, 0), shaft))
    return pieces


def cross(rng: np.random.Generator) -> list[Part]:
    """A cross, T, star or toy of bars, 5..28 cm, flat or round: about the shape of a plane."""
    length = rng.uniform(0.05, 0.28)
    span, high = length * rng.uniform(0.5, 1.1), rng.uniform(0.004, 0.03)
    thick = length * rng.uniform(0.06, 0.18)
    skin, second = paint.look(rng), paint.look(rng)
    place = length * rng.uniform(-0.1, 0.45)
    half = length / 2
    if rng.random() < 0.5:
        body = parts.lathe([[-half, 0.5 * thick], [half, 0.5 * thick]], skin, 12)
        body = body.turned(np.diag([1, 1, high / thick])).moved([0, 0, high / 2])
    else:
        body = parts.box((length, thick, high), (0, 0, high / 2), skin, 0.1 * high)
    bar = parts.box(
        (thick * rng.uniform(0.6, 2.0), span, 0.6 * high), (place, 0, 0.5 * high), second, 0.0005
    )
    pieces = [body, bar]
    if rng.random() < 0.5:
        size = (thick, span * rng.uniform(0.3, 0.8), 0.5 * high)
        pieces.append(parts.box(size, (-half + thick, 0, 0.5 * high), second, 0.0005))
    return pieces


def clip_or_key(rng: np.random.Generator) -> list[Part]:
    """A key, hairpin or hook of 25..75 mm, 0.8..2.5 mm thick: about a paperclip."""
    length, wire = rng.uniform(0.025, 0.075), rng.uniform(0.0004, 0.0011)
    skin = paint.plain(rng, colours.metal(rng) if rng.random() < 0.5 else None)
    if rng.random() < 0.5:  # a pin: two legs
        width = length * rng.uniform(0.1, 0.3)
        angle = np.linspace(-np.pi / 2, np.pi / 2, 9)
        bow = np.column_stack([np.cos(angle), np.sin(angle)]) * width / 2
        legs = [[-rng.uniform(0.5, 0.95) * length, side * width / 2] for side in (-1, 1)]
        flat = np.concatenate([legs[:1], bow, legs[1:]])
        path = np.column_stack([flat, np.full(len(flat), wire)])
        return [parts.tube(path, wire, skin, 7)]
    head, high = length * rng.uniform(0.2, 0.35), 2 * wire
    pieces = [
        paint.ring(0.25 * head, 0.5 * head, 0.0, high, skin, 20),
        parts.box((length - head, 0.2 * head, high), (length / 2, 0, high / 2), skin),
    ]
    for x in rng.uniform(0.55, 0.95, 3) * (length - 0.5 * head):
        size = (0.1 * head, 0.2 * head, high)
        pieces.append(parts.box(size, (x, 0.18 * head, high / 2), skin))
    return pieces


def scissors(rng: np.random.Generator) -> list[Part]:
    """Scissors or pliers of 9..22 cm: two blades that cross, two rings."""
    length, high = rng.uniform(0.09, 0.22), rng.uniform(0.004, 0.01)
    angle = rng.uniform(0.06, 0.35)
    metal, skin = paint.plain(rng, colours.metal(rng)), paint.plain(rng)
    pieces = []
    for number, side in enumerate((-1, 1)):
        c, s = np.cos(angle), side * np.sin(angle)
        turn = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
        low, top = (0.0, 0.55 * high) if number else (0.45 * high, high)
        blade = np.array([[-0.5, -0.04], [0.5, -0.005], [0.5, 0.01], [-0.1, 0.05]]) * length
        grip = paint.ring(0.06 * length, 0.1 * length, 0.0, high, skin, 18)
        grip = grip.moved([-0.45 * length, -side * 0.02 * length, 0])
        pieces += [parts.plate(blade, low, top, metal).turned(turn), grip.turned(turn)]
    return pieces


def die_or_block(rng: np.random.Generator) -> list[Part]:
    """A die, peg or small block of 1..5 cm, with knobs on top perhaps: about a toy brick."""
    size = rng.uniform(0.01, 0.05, 3) * [1, 1, 0.7]
    size[2] = max(size[2], 0.008)
    pieces = [paint.slab(rng, size.tolist(), paint.look(rng), rng.uniform(0, 0.25))]
    if rng.random() < 0.6:
        skin = paint.plain(rng)
        knob = 0.2 * float(size[:2].min())
        spot = parts.ellipse(knob, knob, 10)
        rise = rng.choice([0.0003, rng.uniform(0.001, 0.004)])
        for x, y in rng.choice([-0.28, 0.0, 0.28], (int(rng.integers(1, 6)), 2)):
            pieces.append(paint.upon(spot + [x * size[0], y * size[1]], size[2], skin, rise))
    return pieces
