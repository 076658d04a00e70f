"""Cables, which lie over what is under them: a tube about a spine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from scenefw.core.tabletop import TexturedMesh
from scenefw_tabletops.shapes.desk import paint
from scenefw_tabletops.shapes.tabletop import colours, parts
from scenefw_tabletops.shapes.tabletop.parts import Array, Look, Part

_SIDES = 7
_STEP = 0.005  # m between points of the spine


def cable(rng: np.random.Generator) -> TexturedMesh:
    """A cable of 2..7 mm over 10..45 cm, wound up, snaking or in a loop, with plugs or cut ends."""
    radius = rng.uniform(0.001, 0.0035)
    flat = _evenly((_coil, _snake, _loop)[rng.choice(3, p=[0.25, 0.5, 0.25])](rng, radius))
    spine = np.column_stack([flat, np.full(len(flat), radius)])
    tube = parts.tube(spine, radius, paint.plain(rng), _SIDES)
    knots = [*np.repeat(np.arange(len(spine)), _SIDES), *[0] * _SIDES, *[len(spine) - 1] * _SIDES]
    pieces = [tube]
    for end, before in ((0, 2), (len(spine) - 1, len(spine) - 3)):
        if rng.random() < 0.7:
            plug = _plug(rng, spine[end], spine[end] - spine[before], radius)
            pieces += plug
            knots += [end] * sum(len(part.vertices) for part in plug)
    mesh = parts.merge(pieces)
    vertices = np.concatenate([part.vertices for part in pieces])
    offset = mesh.vertices[0] - vertices[0]
    return replace(mesh, spine=spine + offset, knots=np.array(knots, dtype=np.int64))


def _evenly(path: Array) -> Array:
    """Points `_STEP` apart along a path (P, 2)."""
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    places = np.linspace(0, along[-1], max(6, int(along[-1] / _STEP)))
    return np.column_stack([np.interp(places, along, path[:, k]) for k in range(2)])


def _smooth_curve(points: Array) -> Array:
    t = np.arange(len(points))
    dense = np.linspace(0, len(points) - 1, 24 * len(points))
    return np.asarray(CubicSpline(t, points)(dense))


def _snake(rng: np.random.Generator, radius: float) -> Array:
    count, length = int(rng.integers(4, 8)), rng.uniform(0.12, 0.45)
    x = np.linspace(-0.5, 0.5, count) * length
    sides = np.where(np.arange(count) % 2, 1, -1)
    y = sides * rng.uniform(0.1, 1.0, count) * min(length, 0.2) * 0.3
    return _smooth_curve(np.column_stack([x, y]))


def _loop(rng: np.random.Generator, radius: float) -> Array:
    """Most of a turn, then straight on."""
    size = rng.uniform(0.03, 0.09)
    angle = np.linspace(0, rng.uniform(1.2, 1.75) * np.pi, 7)
    around = size * np.column_stack([np.cos(angle), np.sin(angle) * rng.uniform(0.6, 1)])
    tangent = (around[-1] - around[-2]) * rng.uniform(0.8, 1.6)
    tail = [around[-1] + tangent * step for step in (1, 2)]
    return _smooth_curve(np.concatenate([around, tail]))


def _coil(rng: np.random.Generator, radius: float) -> Array:
    turns = rng.uniform(1.4, 2.8)
    angle = np.linspace(0, 2 * np.pi * turns, int(30 * turns))
    distance = rng.uniform(0.02, 0.035) + 2.4 * radius * angle / (2 * np.pi)
    along = distance * (1 + 0.04 * np.sin(3 * angle + rng.uniform(0, 6)))
    spiral = np.column_stack([np.cos(angle) * along, np.sin(angle) * along * rng.uniform(0.7, 1)])
    tangent = spiral[-1] - spiral[-2]
    tail = spiral[-1] + tangent * np.arange(1, 12)[:, None] * rng.uniform(0.3, 0.9)
    return np.concatenate([spiral, tail])


def _plug(rng: np.random.Generator, end: Array, ahead: Array, radius: float) -> list[Part]:
    c, s = ahead[:2] / np.linalg.norm(ahead[:2])
    length, width = rng.uniform(0.015, 0.035), rng.uniform(0.006, 0.016)
    height = max(rng.uniform(0.004, 0.009), 2 * radius)
    metal = Look(colours.grey(0.75), gloss=0.7)
    case = parts.box((length, width, height), (length / 2, 0, height / 2), paint.plain(rng), 0.001)
    size = (0.010, 0.7 * width, 0.5 * height)
    tip = parts.box(size, (length + 0.005, 0, height / 2), metal)
    turn = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    return [part.turned(turn).moved([end[0], end[1], 0]) for part in (case, tip)]
