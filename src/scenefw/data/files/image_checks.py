"""Checks of depth and colour that come from outside, whether from files or as arrays."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError, EmptyImageError, InputError
from scenefw.data.files.layouts import MILLIMETRES

Array = NDArray[Any]

_FARTHEST_MEDIAN = 20.0
"""A table-top whose median depth is above this (m) was given in millimetres."""
_NEAREST_MEDIAN = 0.05
"""A table-top whose median depth is below this (m) was given in metres, read as millimetres."""

_UNITS = {
    1.0: "metres", 1e-2: "centimetres", 1e-3: "millimetres", 1e-4: "tenths of millimetres",
    1e-6: "micrometres",
}  # fmt: skip

_MIN_GAP_RATIO = 2.0
"""A placeholder is this many times as far as all else: a table seen straight from above, without
noise, is a value that many pixels share, too, but no object reaches half the way to the camera."""
_MIN_SURFACE_GAP_RATIO = 1.2
"""The same where all else is a surface seen at an angle or with noise, not tops at few heights."""
_MAX_SHARED = 0.1  # of the measurements of such a surface have one and the same value
_MIN_SHARED = 0.02  # of all measurements have the value of a placeholder within their range
_MIN_STEP_RATIO = 1.02  # of depth across an edge: steps of a Kinect's disparities at 4 m are 1 %
_MIN_RIM_RATIO = 0.1  # of pixels to neighbours: holes of real images have 0.16 to 0.48, walls 0.03
_SAMPLE = 20_000  # measurements say which value is frequent
_MIN_PLACEHOLDER_PIXELS = 20
_MAX_PLACEHOLDERS = 4  # too near, too far, unsure, saturated


@dataclass(frozen=True)
class Stored:
    """How depth is stored, by which it takes one remedy or another for a wrong unit.

    Args:
        unit: metres per unit, as it was read.
        key: of an array of a fixed unit; None: of whole numbers, whose unit a setting may say.
    """

    unit: float = 1.0
    key: str | None = "depth in floats"


_METRES = Stored()


def check_depth(depth: Array, name: str, stored: Stored = _METRES) -> NDArray[np.float32]:
    """Depth (H, W) in metres as float32 with every unusable value (NaN, infinite, <= 0) set to 0.

    Args:
        depth: (H, W) m.
        name: of the image, for messages.
        stored: how it was, for messages.

    Raises:
        InputError: not two-dimensional, without any measurement (EmptyImageError), or in the wrong
            unit.
    """
    if depth.ndim != 2 or min(depth.shape) < 2:
        raise InputError(f"depth of {name} has shape {depth.shape}; expected one image (H, W)")
    depth = depth.astype(np.float32)
    clean = np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))
    valid = clean[clean > 0]
    if valid.size == 0:
        raise EmptyImageError(
            f"depth of {name} has no measurements ({_unusable(depth)}); record it again or check "
            "the file"
        )
    median = float(np.median(valid))
    if median > _FARTHEST_MEDIAN:
        raise InputError(
            f"depth of {name} has a median of {median:.6g} m{_likely_unit(median, stored)}"
        )
    if median < _NEAREST_MEDIAN:
        raise InputError(
            f"depth of {name} has a median of {median * 1000:.2g} mm: metres given as millimetres? "
            "store it as depth in metres, or give the run.depth_scale of whole numbers"
        )
    return clean


def _likely_unit(median: float, stored: Stored) -> str:
    """Which unit would make a table-top of a median depth (m), and what to do about it."""
    unit = min(_UNITS, key=lambda unit: abs(math.log(median * unit / stored.unit)))
    likely = _NEAREST_MEDIAN < median * unit / stored.unit < _FARTHEST_MEDIAN
    read_as = _UNITS.get(stored.unit, f"units of {stored.unit:g} m")
    guess = f": {_UNITS[unit]} given as {read_as}? " if likely else "; "
    if stored.key is not None:
        remedy = f"multiply it by {unit / stored.unit:g}" if likely else "store it so"
        return f"{guess}{stored.key} is in {read_as}; {remedy}"
    return f"{guess}give run.depth_scale={f'{unit:g}' if likely else 'METRES_PER_UNIT'}"


def metres(
    values: Array, scale: float | None, name: str, unit: float = MILLIMETRES
) -> NDArray[np.float32]:
    """Depth in metres as float32: floats are metres, whole numbers times `scale`, None = `unit`.

    Raises:
        InputError: values of another kind, or floats, for which a scale would change nothing.
        ConfigError: a scale that is not positive.
    """
    if scale is not None and not scale > 0:
        raise ConfigError(f"depth_scale = {scale}: expected metres per unit, above 0")
    if values.dtype.kind == "f":
        if scale is not None:
            raise unused_scale(scale, name, "depth in floats is in metres")
        return values.astype(np.float32)
    if values.dtype.kind not in "ui":
        raise InputError(
            f"depth of {name} is of {values.dtype}; give floats in metres, or whole numbers with "
            "depth_scale"
        )
    return (values * np.float64(unit if scale is None else scale)).astype(np.float32)


def placeholders(depth: NDArray[np.float32]) -> list[float]:
    """Values (m) of an image that stand for "no measurement", as 65535 or 1e10 do.

    Many pixels share such a value exactly, at one end of all values, and nothing else is near it.

    Args:
        depth: (H, W) m; 0 and what isn't finite is no measurement anyway.
    """
    values = depth[np.isfinite(depth) & (depth > 0)]
    ends: list[float] = []
    while values.size and len(ends) < _MAX_PLACEHOLDERS:
        low, high = values.min(), values.max()
        above, below = values[values > low], values[values < high]
        if _is_placeholder(depth == high, high, below.max(initial=0), below):
            ends.append(float(high))
            values = below
        elif above.size and _is_placeholder(depth == low, above.min(), 2 * low, above):
            ends.append(float(low))
            values = above
        else:
            break
    within = _placeholder_within(np.where(np.isin(depth, ends), np.float32(0), depth))
    return ends if within is None else [*ends, within]


def _placeholder_within(depth: NDArray[np.float32]) -> float | None:
    """A value (m) that stands for "no measurement", although others lie beyond it.

    A room goes on further than 4 m, say. Many pixels share the value, no other is so frequent, they
    are ragged as holes are, and end where depth jumps to something nearer. Walls aren't ragged, and
    steps of disparity on them end at others.
    """
    values = depth[np.isfinite(depth) & (depth > 0)]
    if not values.size:
        return None
    sample = values[:: max(1, values.size // _SAMPLE)]
    distinct, counts = np.unique(sample, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    first = order[0]
    if not _MIN_SHARED * sample.size < counts[first] < sample.size / 2:
        return None
    if len(order) > 1 and counts[order[1]] > counts[first] / 2:
        return None
    value, nearer, neighbours = distinct[first], 0, 0
    if value == values.max():
        return None
    for image in (depth, depth.T):
        for a, b in ((image[:-1], image[1:]), (image[1:], image[:-1])):
            beside = b[(a == value) & (b != value) & np.isfinite(b) & (b > 0)]
            neighbours += beside.size
            nearer += int((beside * _MIN_STEP_RATIO < value).sum())
    is_ragged = neighbours > _MIN_RIM_RATIO * np.count_nonzero(depth == value)
    return float(value) if is_ragged and nearer > (1 - _MAX_SHARED) * neighbours else None


def _is_placeholder(
    pixels: NDArray[np.bool_],
    far: np.floating[Any],
    near: np.floating[Any],
    others: NDArray[np.float32],
) -> bool:
    """Whether the value of pixels (H, W) is far from all others (N,)."""
    if pixels.sum() < _MIN_PLACEHOLDER_PIXELS or not far > _MIN_SURFACE_GAP_RATIO * near > 0:
        return False
    if pixels.any(axis=0).sum() == 1 or pixels.any(axis=1).sum() == 1:
        return False  # a row of a floor without noise, at the horizon
    if far > _MIN_GAP_RATIO * near:
        return True
    return bool(np.unique(others, return_counts=True)[1].max() < _MAX_SHARED * others.size)


def unit_of(scale: float, values: Array, name: str) -> float:
    """Metres per unit of integer depth (H, W), from the number that a file calls `depth_scale`.

    It is metres per unit (RealSense), millimetres per unit (BOP) or units per metre (TUM, Open3D);
    only one of them makes the image a table-top's.

    Raises:
        InputError: the number is not positive, or none of them does.
    """
    measured = values[values > 0]
    if not 0 < scale < np.inf:
        raise InputError(f"depth_scale of {name} is {scale:g}; expected metres per unit, above 0")
    median = float(np.median(measured)) if measured.size else 0.0
    units = {scale, scale * MILLIMETRES, 1 / scale}
    plausible = [unit for unit in units if _NEAREST_MEDIAN < unit * median < _FARTHEST_MEDIAN]
    if not median:
        return scale
    if len(plausible) != 1:
        raise InputError(
            f"depth_scale of {name} is {scale:g}, which makes the median depth "
            f"{scale * median:.3g} m; expected metres per unit: correct it, or give run.depth_scale"
        )
    return plausible[0]


def check_colour(colour: Array, shape: tuple[int, ...], name: str) -> NDArray[np.uint8]:
    """Colour (H, W, 3) uint8 of an image.

    Raises:
        InputError: another shape or type.
    """
    if colour.shape != (*shape, 3):
        raise InputError(
            f"colour of {name} has shape {colour.shape}, its depth {tuple(shape)}; both must be "
            "aligned images of the same size, colour with 3 channels; leave it out if it isn't"
        )
    if colour.dtype != np.uint8:
        raise InputError(f"colour of {name} is of {colour.dtype}; give uint8, 0 to 255")
    return colour


def unused_scale(scale: float, name: str, why: str) -> InputError:
    """The error for a scale that is given for depth whose unit is known."""
    return InputError(f"depth_scale = {scale} changes nothing for {name}: {why}; leave it out")


def _unusable(depth: Array) -> str:
    """How many pixels of an image without measurements have which value."""
    counts = {
        "0": (depth == 0).sum(),
        "NaN": np.isnan(depth).sum(),
        "infinite": np.isinf(depth).sum(),
        "negative": (np.isfinite(depth) & (depth < 0)).sum(),
    }
    phrases = [f"{count} {kind}" for kind, count in counts.items() if count]
    return f"of {depth.size} pixels {', '.join(phrases)}"
