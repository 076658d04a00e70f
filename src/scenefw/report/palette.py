"""Colours of instances that people with any colour vision tell apart."""

import colorsys
from collections.abc import Sequence

Colour = tuple[float, float, float]

# Okabe and Ito (2008), black and the hard to see yellow left out, then lighter and darker kin.
_OKABE_ITO = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00")
_KIN = (0.0, 0.45, -0.4)


def instance_colours(number: int) -> list[Colour]:
    """Red, green, blue in [0, 1] of instances 1..number; repeats after 18."""
    cycle = [_shifted(_rgb(text), shift) for shift in _KIN for text in _OKABE_ITO]
    return [cycle[index % len(cycle)] for index in range(number)]


def _rgb(text: str) -> Colour:
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


def _shifted(colour: Sequence[float], shift: float) -> Colour:
    """The colour moved towards white (shift > 0) or black (shift < 0)."""
    hue, lightness, saturation = colorsys.rgb_to_hls(*colour)
    target = 1.0 if shift > 0 else 0.0
    return colorsys.hls_to_rgb(hue, lightness + abs(shift) * (target - lightness), saturation)
