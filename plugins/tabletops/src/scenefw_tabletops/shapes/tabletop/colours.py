"""Random colours of materials, linear, in 0..1."""

from __future__ import annotations

import colorsys

import numpy as np

from scenefw.core.tabletop import CHECKER, NOISE, PLAIN, SPECKLE, STRIPES, WOOD
from scenefw_tabletops.shapes.tabletop.parts import Colour, Look


def hsv(hue: float, saturation: float, value: float) -> Colour:
    """Linear colour of hue, saturation and value as displays show them."""
    red, green, blue = (part**2.2 for part in colorsys.hsv_to_rgb(hue % 1, saturation, value))
    return red, green, blue


def grey(value: float) -> Colour:
    """Linear grey of a displayed value."""
    return hsv(0.0, 0.0, value)


def vivid(rng: np.random.Generator) -> Colour:
    """The colour of a toy."""
    return hsv(rng.random(), rng.uniform(0.55, 0.95), rng.uniform(0.5, 0.95))


def plastic(rng: np.random.Generator) -> Colour:
    """The colour of a device: mostly black, grey or white, now and then coloured."""
    kind = rng.choice(4, p=[0.45, 0.2, 0.2, 0.15])
    if kind == 0:
        return hsv(rng.random(), 0.1, rng.uniform(0.10, 0.28))
    if kind == 1:
        return hsv(rng.random(), 0.08, rng.uniform(0.4, 0.65))
    if kind == 2:
        return hsv(rng.uniform(0.05, 0.2), rng.uniform(0, 0.12), rng.uniform(0.8, 0.95))
    return hsv(rng.random(), rng.uniform(0.3, 0.7), rng.uniform(0.35, 0.8))


def metal(rng: np.random.Generator) -> Colour:
    """Silver, brass or copper."""
    hue, saturation, value = ((0.6, 0.04, 0.78), (0.12, 0.45, 0.78), (0.06, 0.5, 0.7))[
        rng.choice(3, p=[0.5, 0.3, 0.2])
    ]
    return hsv(hue, saturation, value * rng.uniform(0.85, 1.1))


def contrast(colour: Colour, rng: np.random.Generator) -> Colour:
    """What is printed on a colour: dark on light, light on dark."""
    dark = float(np.mean(colour)) < 0.2
    return grey(rng.uniform(0.75, 0.95) if dark else rng.uniform(0.08, 0.25))


def shade(colour: Colour, factor: float) -> Colour:
    """Lighter or darker."""
    red, green, blue = (min(1.0, part * factor) for part in colour)
    return red, green, blue


def device(rng: np.random.Generator, colour: Colour) -> Look:
    """Plastic of a device: plain, or grained a little."""
    kind = int(rng.choice([PLAIN, NOISE, SPECKLE], p=[0.6, 0.25, 0.15]))
    second = shade(colour, rng.choice([0.6, 1.5]))
    return Look(
        colour, kind, rng.uniform(0.002, 0.006), rng.uniform(0.2, 0.6), 0.0, second,
        rng.uniform(0.0, 0.35),
    )  # fmt: skip


def painted(rng: np.random.Generator, colour: Colour, second: Colour) -> Look:
    """Paint of a toy or a cover: plain or with a pattern."""
    kind = int(rng.choice([PLAIN, STRIPES, CHECKER, NOISE], p=[0.5, 0.2, 0.08, 0.22]))
    return Look(
        colour, kind, rng.uniform(0.012, 0.03), rng.uniform(0.5, 1.0),
        rng.choice([0.0, np.pi / 2, rng.uniform(0, np.pi)]), second, rng.uniform(0.05, 0.4),
    )  # fmt: skip


def table(rng: np.random.Generator) -> Look:
    """Table-tops: wood, cloth, stone, laminate."""
    kind = int(rng.choice([WOOD, NOISE, CHECKER, STRIPES, SPECKLE, PLAIN],
                          p=[0.4, 0.2, 0.1, 0.08, 0.14, 0.08]))  # fmt: skip
    angle = rng.uniform(0, np.pi)
    if kind == WOOD:
        colour = hsv(rng.uniform(0.05, 0.12), rng.uniform(0.25, 0.6), rng.uniform(0.4, 0.85))
        return Look(
            colour, kind, rng.uniform(0.008, 0.03), rng.uniform(0.4, 0.9), angle,
            shade(colour, rng.uniform(0.4, 0.7)), rng.uniform(0, 0.2),
        )  # fmt: skip
    colour = hsv(rng.random(), rng.uniform(0.0, 0.45), rng.uniform(0.35, 0.9))
    if kind in (CHECKER, STRIPES):
        period, second = rng.uniform(0.015, 0.08), shade(colour, rng.uniform(0.45, 0.8))
    elif kind == NOISE:
        period, second = rng.uniform(0.01, 0.08), shade(colour, rng.choice([0.45, 1.7]))
    else:
        period, second = rng.uniform(0.003, 0.008), contrast(colour, rng)
    return Look(colour, kind, period, rng.uniform(0.3, 0.8), angle, second, rng.uniform(0, 0.2))
