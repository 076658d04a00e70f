"""Decodes depth compressed as RVL (Wilson 2017, "Fast lossless depth image compression")."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_NIBBLES = 8  # in a word of 32 bits, the highest first
_MAX_NIBBLES = 11  # of a number: three bits of it in each
_MAX_PIXELS = 100_000_000
"""More are no depth image but damage, and would not fit into memory."""


def decode_rvl(data: bytes, pixels: int) -> NDArray[np.uint16]:
    """Values (pixels,), 0 = none.

    The stream alternates counts of zeros and of others, each of those as the difference from the
    one before it.

    Args:
        data: words of 32 bits, little-endian.
        pixels: number of pixels.

    Raises:
        ValueError: the data end early or hold more than that.
    """
    if pixels > _MAX_PIXELS:
        raise ValueError(f"{pixels} pixels are too many")
    numbers = _numbers(np.frombuffer(data[: len(data) // 4 * 4], "<u4"))
    values = np.zeros(pixels, np.int64)
    place = position = 0
    previous = 0
    while place < pixels:
        if position + 2 > len(numbers):
            raise ValueError(f"it ends after {place} of {pixels} pixels")
        zeros, others = (int(n) for n in numbers[position : position + 2])
        place, position = place + zeros, position + 2
        coded = numbers[position : position + others]
        if len(coded) < others or place + others > pixels:
            raise ValueError(f"runs of RVL don't fit {pixels} pixels")
        if others:
            run = previous + np.cumsum((coded >> 1) ^ -(coded & 1))
            values[place : place + others] = run
            previous = int(run[-1])
        elif not zeros:
            raise ValueError("an empty run")
        place, position = place + others, position + others
    if place > pixels or values.min(initial=0) < 0 or values.max(initial=0) > 65535:
        raise ValueError("values beyond 16 bits")
    return values.astype(np.uint16)


def _numbers(words: NDArray[np.uint32]) -> NDArray[np.int64]:
    """All numbers of a stream of nibbles: three bits of a number each, the low ones first.

    The fourth bit says that the number goes on.
    """
    shifts = np.arange(4 * (_NIBBLES - 1), -1, -4, dtype=np.uint32)
    nibbles = ((words[:, None] >> shifts) & 15).ravel().astype(np.int64)
    ends = np.flatnonzero(nibbles < 8)
    if not ends.size:
        return np.zeros(0, np.int64)
    starts = np.concatenate([[0], ends[:-1] + 1])
    used = nibbles[: ends[-1] + 1]
    lengths = ends - starts + 1
    if lengths.max() > _MAX_NIBBLES:
        raise ValueError("a number of more than 32 bits")
    within = np.arange(len(used)) - np.repeat(starts, lengths)
    return np.add.reduceat((used & 7) << (3 * within), starts)
