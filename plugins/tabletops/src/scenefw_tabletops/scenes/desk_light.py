"""Tables and lamps of cluttered desks: cloths, prints and wood; tinted light, strong shadows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenefw.core.tabletop import (
    CHECKER,
    DOTS,
    FLORAL,
    GINGHAM,
    NOISE,
    PLAIN,
    PRINT,
    SPECKLE,
    STRIPES,
    WOOD,
    Light,
)
from scenefw_tabletops.shapes.tabletop import colours
from scenefw_tabletops.shapes.tabletop.parts import Look

_KINDS = (WOOD, NOISE, CHECKER, STRIPES, SPECKLE, PLAIN, GINGHAM, DOTS, FLORAL, PRINT)
_SHARES = (0.24, 0.12, 0.06, 0.10, 0.09, 0.07, 0.09, 0.07, 0.11, 0.05)
_PERIODS = {
    WOOD: (0.008, 0.03), SPECKLE: (0.003, 0.009), PRINT: (0.005, 0.012), FLORAL: (0.02, 0.08),
}  # fmt: skip


def surface(rng: np.random.Generator) -> Look:
    """A table or its cloth."""
    kind = int(rng.choice(_KINDS, p=_SHARES))
    angle, gloss = rng.uniform(0, np.pi), rng.choice([0.0, rng.uniform(0.0, 0.5)])
    if kind == WOOD:
        first = colours.hsv(rng.uniform(0.03, 0.12), rng.uniform(0.2, 0.65), rng.uniform(0.3, 0.85))
        second = colours.shade(first, rng.uniform(0.4, 0.7))
    else:
        first = colours.hsv(rng.random(), rng.uniform(0.0, 0.5), rng.uniform(0.25, 0.95))
        second = colours.shade(first, rng.uniform(0.4, 0.75))
        if kind in (FLORAL, DOTS, STRIPES) and rng.random() < 0.5:
            second = colours.vivid(rng)
        if kind == PRINT:
            second = colours.contrast(first, rng)
    period = rng.uniform(*_PERIODS.get(kind, (0.012, 0.07)))
    return Look(first, kind, period, rng.uniform(0.3, 0.75), angle, second, gloss)


def lamps(
    rng: np.random.Generator,
) -> tuple[tuple[Light, ...], tuple[float, float, float]]:
    """One to three lamps and the light of the room; together 0.55 to 1.25 at the table's middle."""
    cast = _tint(rng, 0.12)
    sources, strength = [], 0.0
    for number in range(int(rng.choice([1, 2, 3], p=[0.45, 0.4, 0.15]))):
        elevation, azimuth = np.deg2rad(rng.uniform(28, 80)), rng.uniform(0, 2 * np.pi)
        ahead = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
        position = rng.uniform(0.8, 2.5) * np.array([*ahead, np.sin(elevation)])
        share = rng.uniform(0.5, 1.0) * 0.5**number
        sources.append((position, share * cast * _tint(rng, 0.12)))
        strength += share * np.sin(elevation)
    room = rng.uniform(0.2, 0.9) * strength
    scale = rng.uniform(0.55, 1.25) / (strength + room)
    ambient = room * scale * cast * _tint(rng, 0.1)
    lights = tuple(Light(_three(place), _three(scale * light)) for place, light in sources)
    return lights, _three(ambient)


def _tint(rng: np.random.Generator, amount: float) -> NDArray[np.float64]:
    """From blue to orange, and a little from green to magenta."""
    warm, green = rng.uniform(-amount, 1.5 * amount), rng.uniform(-0.4, 0.4) * amount
    return np.array([1 + warm, 1 + green, 1 - warm])


def _three(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
