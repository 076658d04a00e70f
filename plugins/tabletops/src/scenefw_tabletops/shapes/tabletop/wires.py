"""Bent wires: cables with plugs, paperclips."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Array, Look, Part


def cable(rng: np.random.Generator) -> list[Part]:
    """A cable of 3..7 mm, wound up or snaking over 10..22 cm, with a plug at either end."""
    radius = rng.uniform(0.0015, 0.0035)
    look = colours.device(rng, colours.plastic(rng))
    path = _coil(rng, radius) if rng.random() < 0.45 else _snake(rng)
    path = np.column_stack([path, np.full(len(path), radius)])
    pieces = [parts.tube(path, radius, look, 10)]
    for end, before in ((path[0], path[2]), (path[-1], path[-3])):
        pieces += _plug(rng, end, end - before, radius)
    return pieces


def _snake(rng: np.random.Generator) -> Array:
    count, length = int(rng.integers(4, 8)), rng.uniform(0.10, 0.22)
    x = np.linspace(-0.5, 0.5, count) * length
    sides = np.where(np.arange(count) % 2, 1, -1)
    y = sides * rng.uniform(0.2, 1.0, count) * length * 0.25
    t = np.linspace(0, count - 1, 16 * count)
    return np.asarray(CubicSpline(np.arange(count), np.column_stack([x, y]))(t))


def _coil(rng: np.random.Generator, radius: float) -> Array:
    turns = rng.uniform(1.6, 3.6)
    angle = np.linspace(0, 2 * np.pi * turns, int(36 * turns))
    start = rng.uniform(0.02, 0.035)
    distance = start + 2.15 * radius * angle / (2 * np.pi)
    squash = rng.uniform(0.7, 1.0)
    ripple = 1 + 0.04 * np.sin(3 * angle + rng.uniform(0, 6))
    along = distance * ripple
    spiral = np.column_stack([np.cos(angle) * along, np.sin(angle) * along * squash])
    tangent = spiral[-1] - spiral[-2]
    tail = spiral[-1] + tangent * np.arange(1, 12)[:, None] * rng.uniform(0.3, 0.9)
    return np.concatenate([spiral, tail])


def _plug(rng: np.random.Generator, end: Array, ahead: Array, radius: float) -> list[Part]:
    ahead = ahead / np.linalg.norm(ahead)
    c, s = ahead[:2]
    length, width = rng.uniform(0.018, 0.028), rng.uniform(0.009, 0.014)
    height = max(rng.uniform(0.005, 0.008), 2 * radius)
    body = Look(colours.plastic(rng), gloss=0.2)
    metal = Look(colours.grey(0.75), gloss=0.7)
    case = parts.box((length, width, height), (length / 2, 0, height / 2), body, 0.001)
    size = (0.012, 0.75 * width, 0.5 * height)
    tip = parts.box(size, (length + 0.006, 0, height / 2), metal)
    turn = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    return [part.turned(turn).moved([end[0], end[1], 0]) for part in (case, tip)]


def paperclip(rng: np.random.Generator) -> list[Part]:
    """A paperclip of 3..6 cm, wire of 1.4..2.4 mm."""
    length = rng.uniform(0.03, 0.06)
    width, wire = length * rng.uniform(0.22, 0.3), rng.uniform(0.0007, 0.0012)
    colour = colours.metal(rng) if rng.random() < 0.5 else colours.vivid(rng)
    look = Look(colour, gloss=rng.uniform(0.2, 0.7))
    half = width / 2
    step = max(0.16 * width, 2.2 * wire)
    path = [np.array([[0.15 * length, half]])]
    # Three bends, each inside the one before: (x of its middle, radius, to the right?)
    for x, radius, right in (
        (-0.5 * length + half, half, False),
        (0.5 * length - half + step / 2, half - step / 2, True),
        (-0.32 * length + half, half - step, False),
    ):
        turn = np.linspace(0, np.pi, 12)
        if right:
            arc = [x + radius * np.sin(turn), -half + radius - radius * np.cos(turn)]
        else:
            top = half if not len(path) > 1 else half - step
            arc = [x - radius * np.sin(turn), top - radius + radius * np.cos(turn)]
        path.append(np.column_stack(arc))
    path.append(np.array([[0.2 * length, path[-1][-1, 1]]]))
    flat = np.concatenate(path)
    return [parts.tube(np.column_stack([flat, np.full(len(flat), wire)]), wire, look, 8)]
