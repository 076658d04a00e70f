"""Round things without a class: discs, rings, cups, plates, rolls, cells, bands, mice."""

from __future__ import annotations

import numpy as np

from scenefw_tabletops.shapes.desk import paint
from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Look, Part


def washer(rng: np.random.Generator) -> list[Part]:
    """A washer or ring of 12..40 mm, 1..3 mm thick."""
    outer = rng.uniform(0.006, 0.02)
    high = rng.uniform(0.001, 0.003)
    skin = paint.plain(rng, colours.metal(rng) if rng.random() < 0.6 else None)
    return [paint.ring(outer * rng.uniform(0.3, 0.85), outer, 0.0, high, skin)]


def disc(rng: np.random.Generator) -> list[Part]:
    """A token, button, lid or bottle cap of 14..45 mm, 1.4..8 mm thick."""
    size = rng.uniform(0.014, 0.045)
    high = float(rng.choice([rng.uniform(0.0014, 0.003), rng.uniform(0.003, 0.008)]))
    metal = rng.random() < 0.5
    skin = paint.plain(rng, colours.metal(rng)) if metal else paint.look(rng)
    disc_ = parts.ellipse(size, size, 28)
    pieces = [parts.plate(disc_, 0.0, high, skin, 0.2 * high)]
    kind = rng.integers(4)
    if kind == 0:  # holes of a button
        for x, y in ((-1, 0), (1, 0), (0, -1), (0, 1))[: int(rng.choice([2, 4]))]:
            hole = parts.ellipse(0.13 * size, 0.13 * size, 8) + np.array([x, y]) * 0.14 * size
            pieces.append(paint.upon(hole, high, Look(colours.grey(0.1))))
    elif kind == 1:  # a rim
        pieces.append(paint.ring(0.4 * size, 0.47 * size, high - 0.0003, high + 0.0004, skin))
    elif kind == 2:  # a print
        pieces.append(paint.upon(0.7 * disc_, high, paint.look(rng)))
    return pieces


def cup(rng: np.random.Generator) -> list[Part]:
    """A cup or jar of 4..9 cm across, 2..8 cm high, hollow or full."""
    radius, high = rng.uniform(0.02, 0.045), rng.uniform(0.02, 0.08)
    foot, wall = radius * rng.uniform(0.65, 1.0), rng.uniform(0.0018, 0.004)
    skin = paint.look(rng)
    profile = [
        (0, 0),
        (foot, 0),
        (radius, high),
        (radius - wall, high),
        (foot - wall, wall),
        (0, wall),
    ]
    pieces = [paint.revolved(profile, skin)]
    if rng.random() < 0.5:
        level = rng.uniform(0.4, 0.85)
        wide = 2 * (foot + (radius - foot) * level - wall / 2)
        drink = Look(colours.hsv(rng.uniform(0.03, 0.15), 0.7, rng.uniform(0.1, 0.6)), gloss=0.7)
        pieces.append(parts.plate(parts.ellipse(wide, wide, 28), wall, level * high, drink))
    if rng.random() < 0.5:
        angle = np.linspace(-1.3, 1.3, 9)
        bow = np.column_stack([0.95 * radius + 0.3 * high * np.cos(angle), np.zeros(9),
                               0.55 * high + 0.3 * high * np.sin(angle)])  # fmt: skip
        pieces.append(parts.tube(bow, rng.uniform(0.003, 0.005), skin, 8))
    return pieces


def plate(rng: np.random.Generator) -> list[Part]:
    """A saucer or plate of 8..20 cm, 1..2 cm high."""
    radius, high = rng.uniform(0.04, 0.1), rng.uniform(0.008, 0.02)
    wall, foot = rng.uniform(0.002, 0.004), radius * rng.uniform(0.5, 0.75)
    profile = [(0, 0), (foot, 0), (radius, high), (radius - 0.002, high + 0.001),
               (foot, wall + 0.001), (0, wall)]  # fmt: skip
    return [paint.revolved(profile, paint.look(rng), 36)]


def roll(rng: np.random.Generator) -> list[Part]:
    """A roll of tape of 3..11 cm, 8..50 mm high."""
    outer = rng.uniform(0.016, 0.055)
    inner, high = outer * rng.uniform(0.5, 0.85), rng.uniform(0.008, 0.05)
    core = paint.ring(inner - 0.0015, inner, 0.0, high, Look(colours.hsv(0.09, 0.4, 0.6)))
    return [paint.ring(inner, outer, 0.0, high, paint.plain(rng)), core]


def cell(rng: np.random.Generator) -> list[Part]:
    """A battery, lipstick or bottle lying down, 4..13 cm by 8..34 mm."""
    length, radius = rng.uniform(0.04, 0.13), rng.uniform(0.004, 0.017)
    half, split = length / 2, rng.uniform(-0.3, 0.3) * length
    first, second = paint.look(rng), paint.plain(rng)
    return [
        parts.lathe([[-half, 0.96 * radius], [-half + 0.002, radius], [split, radius]], first),
        parts.lathe(
            [[split, radius], [half - 0.003, radius], [half - 0.001, 0.9 * radius]], second
        ),
        parts.lathe([[half - 0.001, 0.4 * radius], [half + 0.001, 0.35 * radius]], second, 10),
    ]


def band(rng: np.random.Generator) -> list[Part]:
    """A rubber band, cord or key ring: a closed thin loop of 2..11 cm, 1..3 mm thick."""
    size, wire = rng.uniform(0.01, 0.055), rng.uniform(0.0005, 0.0015)
    angle = np.linspace(0, 2 * np.pi, 49)
    bend = 1 + rng.uniform(0, 0.3) * np.sin(2 * angle + rng.uniform(0, 6))
    bend = bend + rng.uniform(0, 0.12) * np.sin(3 * angle + rng.uniform(0, 6))
    squash = rng.uniform(0.3, 1.0)
    x, y = size * bend * np.cos(angle), size * bend * squash * np.sin(angle)
    path = np.column_stack([x, y, np.full(len(angle), wire)])
    return [parts.tube(path, wire, paint.plain(rng), 7)]


def mouse(rng: np.random.Generator) -> list[Part]:
    """A computer mouse or stone: an oval dome of 6..13 cm."""
    length = rng.uniform(0.06, 0.13)
    width, high = length * rng.uniform(0.45, 0.7), rng.uniform(0.015, 0.04)
    levels = [(0.0, 0.96), (0.25, 1.0), (0.6, 0.92), (0.85, 0.7), (0.96, 0.4), (1.0, 0.1)]
    outline = parts.ellipse(length, width, 24)
    rings = [np.column_stack([s * outline, np.full(24, h * high)]) for h, s in levels]
    pieces = [parts.loft(rings, paint.look(rng), smooth=True)]
    if rng.random() < 0.7:
        wheel = parts.lathe([[-0.003, 0.008], [0.003, 0.008]], paint.plain(rng), 12)
        pieces.append(wheel.turned([[0, -1, 0], [1, 0, 0], [0, 0, 1]]).moved(
            [0.25 * length, 0, 0.88 * high - 0.003]))  # fmt: skip
    return pieces


def controller(rng: np.random.Generator) -> list[Part]:
    """A game controller of 10..17 cm: two grips, sticks and buttons."""
    length = rng.uniform(0.1, 0.17)
    width, high = 0.55 * length, rng.uniform(0.018, 0.035)
    skin, keys = paint.look(rng), [paint.plain(rng) for _ in range(5)]
    pieces = [
        parts.plate(parts.rounded(length, 0.6 * width, 0.25 * width, 5), 0.0, high, skin, 0.006)
    ]
    for side in (-1, 1):
        grip = parts.ellipse(0.36 * length, width, 18) @ [[0.95, side * 0.3], [-side * 0.3, 0.95]]
        place = [side * 0.34 * length, -0.22 * width]
        pieces.append(parts.plate(grip + place, 0.0, 0.93 * high, skin, 0.008))
        stick = parts.ellipse(0.11 * length, 0.11 * length, 16) + [
            side * 0.15 * length,
            -0.1 * width,
        ]
        pieces.append(paint.upon(stick, high, keys[0], 0.006))
    for number, turn in enumerate(np.arange(4) * np.pi / 2):
        spot = np.array([np.cos(turn), np.sin(turn)]) * 0.055 * length
        button = parts.ellipse(0.055 * length, 0.055 * length, 10)
        middle = spot + [0.32 * length, 0.08 * width]
        pieces.append(paint.upon(button + middle, high, keys[1 + number], 0.002))
        mark = parts.rectangle(0.05 * length, 0.05 * length) + spot + [-0.32 * length, 0.08 * width]
        pieces.append(paint.upon(mark, high, keys[0], 0.002))
    return pieces
