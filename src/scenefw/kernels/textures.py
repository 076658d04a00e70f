"""Textures by formula: how much of the second colour there is at a point, for `core.tabletop`.

`size` is the width of what a pixel sees there (m); patterns are smoothed over it.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN201, ANN202

from __future__ import annotations

import math

import numpy as np

from scenefw.core.tabletop import (
    CHECKER,
    DOTS,
    FLORAL,
    GINGHAM,
    NOISE,
    PRINT,
    SPECKLE,
    STRIPES,
    WOOD,
)
from scenefw.kernels.compile import element

ZERO = np.float32(0)
HALF = np.float32(0.5)
ONE = np.float32(1)
_TWO = np.float32(2)
_THREE = np.float32(3)
_QUARTER = np.float32(0.25)
_TURN = np.float32(2 * math.pi)
_LEAST = np.float32(1e-6)
_HASHES = np.float32(1 / 0xFFFF)
_STRETCH = np.float32(1 / 14)  # of the grain of wood
_FIBRE = np.float32(5)
_SOME, _LESS = np.float32(0.7), np.float32(0.35)
_RADIUS = np.float32(0.34)
_WAVES = np.float32(1.6)
_SPOT = np.float32(0.3)
_PETAL = np.float32(0.24)  # least and most radius of a flower: _PETAL -+ _LOBE
_LOBE = np.float32(0.14)
_EYE = np.float32(0.08)
_FIVE = np.float32(5)
_TENDRIL = np.float32(0.045)
_COLUMN = np.float32(1 / 18)  # columns and paragraphs of a page, in lines
_PARAGRAPH = np.float32(1 / 8)
_BORDER = np.float32(0.06)
_PICTURES = np.float32(0.2)  # share of paragraphs that are pictures
_BLANKS = np.float32(0.3)
_WORDS = np.float32(0.45)
_LETTERS = np.float32(2.3)
_LOW, _HIGH = np.float32(0.22), np.float32(0.68)  # of letters in their line


@element
def hashed(x, y, z):
    """A number in [0, 1] for three integers."""
    h = ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & 0x7FFFFFFF
    h = ((h ^ (h >> 13)) * 1274126177) & 0x7FFFFFFF
    return np.float32((h ^ (h >> 15)) & 0xFFFF) * _HASHES


@element
def _blend(a, b, t):
    return a + (b - a) * (t * t * (_THREE - _TWO * t))


@element
def smooth_noise(x, y, z):
    """Noise in [0, 1] with one value per unit of length."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = int(fx), int(fy), int(fz)
    x, y, z = x - np.float32(fx), y - np.float32(fy), z - np.float32(fz)
    low = _blend(
        _blend(hashed(i, j, k), hashed(i + 1, j, k), x),
        _blend(hashed(i, j + 1, k), hashed(i + 1, j + 1, k), x), y,
    )  # fmt: skip
    high = _blend(
        _blend(hashed(i, j, k + 1), hashed(i + 1, j, k + 1), x),
        _blend(hashed(i, j + 1, k + 1), hashed(i + 1, j + 1, k + 1), x), y,
    )  # fmt: skip
    return _blend(low, high, z)


@element
def _wave(x, width):
    """Bars of half a unit, edges as wide as `width`: +1 in a bar, -1 between."""
    edge_distance = _QUARTER - abs(x - np.float32(math.floor(x)) - HALF)
    return max(-ONE, min(ONE, _TWO * edge_distance / max(width, _LEAST)))


@element
def _faded(value, width):
    """Towards the mean where the pattern is finer than pixels."""
    return HALF + (value - HALF) * max(ZERO, min(ONE, _WAVES - width))


@element
def _grain(x, y, z, width):
    bend = smooth_noise(x * _STRETCH, y * HALF, z)
    ring = HALF + HALF * math.sin(_TURN * (y * HALF + _THREE * bend))
    fibre = smooth_noise(x * HALF, y * _FIBRE, z * _FIBRE)
    return _SOME * _faded(ring, width) + _LESS * _faded(fibre, width * _FIBRE)


@element
def _dots(x, y, z, width):
    i, j, k = int(math.floor(x)), int(math.floor(y)), int(math.floor(z))  # noqa: RUF046
    room = ONE - _TWO * _RADIUS
    a = x - np.float32(i) - _RADIUS - room * hashed(i, j, k)
    b = y - np.float32(j) - _RADIUS - room * hashed(i + 57, j, k)
    inside = _RADIUS * hashed(i, j + 31, k) - math.sqrt(a * a + b * b)
    return max(ZERO, min(ONE, inside / max(width, _LEAST) + HALF))


@element
def _spots(x, y, width):
    """Dots in rows, every other row shifted by half."""
    j = int(math.floor(y))  # noqa: RUF046
    a = x + (HALF if j & 1 else ZERO)
    a, b = a - np.float32(math.floor(a)) - HALF, y - np.float32(j) - HALF
    return max(ZERO, min(ONE, (_SPOT - math.sqrt(a * a + b * b)) / max(width, _LEAST) + HALF))


@element
def _flowers(x, y, width):
    """One flower of five petals per cell, turned and shifted, and tendrils between them."""
    i, j = int(math.floor(x)), int(math.floor(y))  # noqa: RUF046
    a = x - np.float32(i) - HALF - (hashed(i, j, 1) - HALF) * _QUARTER
    b = y - np.float32(j) - HALF - (hashed(i, j, 2) - HALF) * _QUARTER
    radius = math.sqrt(a * a + b * b)
    lobes = math.cos(_FIVE * math.atan2(b, a) + _TURN * hashed(i, j, 3))
    petals = min(_PETAL + _LOBE * np.float32(lobes) - radius, radius - _EYE)
    tendril = _TENDRIL - abs(smooth_noise(x * _TWO, y * _TWO, HALF) - HALF)
    inside = max(petals, tendril)
    return _faded(max(ZERO, min(ONE, inside / max(width, _LEAST) + HALF)), width)


@element
def _page(x, y, width):
    """Lines of words in paragraphs, pictures between them; one unit is a line."""
    i, j = int(math.floor(x * _COLUMN)), int(math.floor(y * _PARAGRAPH))  # noqa: RUF046
    u, v = x * _COLUMN - np.float32(i), y * _PARAGRAPH - np.float32(j)
    if min(min(u, ONE - u), min(v, ONE - v)) < _BORDER:
        return ZERO
    kind = hashed(i, j, 7)
    if kind < _PICTURES:
        return _BORDER + smooth_noise(x * HALF, y * HALF, np.float32(j))
    if kind < _BLANKS:
        return ZERO
    row = int(math.floor(y))  # noqa: RUF046
    h = y - np.float32(row)
    end = hashed(i, row, 5) if v > ONE - _PARAGRAPH else ONE
    word = x * _WORDS + _THREE * hashed(row, i, 11)
    w = int(math.floor(word))  # noqa: RUF046
    gap = word - np.float32(w) < _PICTURES or u > end
    letter = hashed(int(math.floor(x * _LETTERS)), row, 3)  # noqa: RUF046
    ink = ZERO if gap or h < _LOW or h > _HIGH or letter < _QUARTER else ONE
    return _QUARTER + (ink - _QUARTER) * max(ZERO, min(ONE, _WAVES - _THREE * width))


@element
def pattern(textures, row, x, y, z, size):
    """Share of the second colour at a point of the object (m)."""
    kind = int(textures[row, 0])
    scale = ONE / textures[row, 1]
    angle = textures[row, 3]
    c, s = math.cos(angle) * scale, math.sin(angle) * scale
    a, b, h, width = c * x + s * y, c * y - s * x, z * scale, size * scale
    share = ZERO
    if kind == STRIPES:  # across the angle on top, and up the sides where they run along it
        share = HALF + HALF * _wave(a if abs(c) > abs(s) else a + h, width)
    elif kind == CHECKER:
        share = HALF + HALF * _wave(a * HALF, width) * _wave(b * HALF, width)
    elif kind == NOISE:
        share = _SOME * _faded(smooth_noise(a, b, h), width)
        share += _LESS * _faded(smooth_noise(a * _TWO, b * _TWO, h * _TWO), width * _TWO)
    elif kind == WOOD:
        share = _grain(a, b, h, width)
    elif kind == SPECKLE:
        share = _dots(a, b, h, width)
    elif kind == GINGHAM:
        share = HALF + _QUARTER * (_wave(a, width) + _wave(b, width))
    elif kind == DOTS:
        share = _spots(a, b, width)
    elif kind == FLORAL:
        share = _flowers(a, b, width)
    elif kind == PRINT:
        share = _page(a, b, width)
    return share * textures[row, 2]
