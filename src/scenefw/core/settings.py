"""Ranges of settings: a value outside of its own is named alone, not in a list of all others."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from scenefw.core.errors import SettingError


@dataclass(frozen=True)
class Range:
    """What a number may be.

    Args:
        expected: the range in words, as a message says it.
        holds: tells whether a number is in it.
    """

    expected: str
    holds: Callable[[Any], bool]

    def require(self, **settings: float | Sequence[float] | None) -> None:
        """Raises unless each setting is in the range; None is a setting that is off.

        Args:
            **settings: values by name; of a sequence each member has to be in the range.

        Raises:
            SettingError: names the first that isn't. NaN is in no range.
        """
        for name, value in settings.items():
            if value is None:
                continue
            members = value if isinstance(value, Sequence) else (value,)
            if not all(self.holds(member) for member in members):
                raise SettingError(name, value, self.expected)


FINITE = Range("a finite number", math.isfinite)
POSITIVE = Range("more than 0", lambda value: value > 0)
NOT_NEGATIVE = Range("0 or more", lambda value: value >= 0)
COUNT = Range("1 or more", lambda value: value >= 1)
SHARE = Range("a share from 0 to 1", lambda value: 0 <= value <= 1)
PART = Range("a share above 0, up to 1", lambda value: 0 < value <= 1)
PROBABILITY = Range("a probability above 0 and below 1", lambda value: 0 < value < 1)


def at_least(low: float) -> Range:
    """Numbers from `low` on."""
    return Range(f"{low:g} or more", lambda value: value >= low)


def below(high: float) -> Range:
    """Numbers from 0 to below `high`."""
    return Range(f"0 or more and below {high:g}", lambda value: 0 <= value < high)


def between(low: float, high: float) -> Range:
    """Numbers from `low` to `high`, both included."""
    return Range(f"a number from {low:g} to {high:g}", lambda value: low <= value <= high)


def above(low: float, why: str) -> Range:
    """Numbers larger than `low`, which belongs to another setting; the message says why."""
    return Range(f"more than {low:g}, {why}", lambda value: value > low)
