"""Whether numbers in a depth image mean what they are taken for: floors are flat."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import InputError
from scenefw.perception.observation.floor_noise import ROUNDING
from scenefw.perception.observation.points import rays

if TYPE_CHECKING:
    from collections.abc import Iterator

    from scenefw.core.floors import Floor
    from scenefw.core.protocols import FloorFinding
    from scenefw.core.types import Camera, Float32, Float64, Frame


def better_reading(frame: Frame, floor: Floor | None, finder: FloorFinding) -> str:
    """What the numbers of a depth image rather are, in words; "": depth along the axis.

    If they are something else, floors are bent. That reading is better whose floor holds more
    points at a smaller distance.

    Args:
        frame: as it was read.
        floor: of it; None: it has none.
        finder: looked for that floor.
    """
    best, words = 0.0 if floor is None else _flatness(floor), ""
    for reading, depth in _readings(frame):
        try:
            flatness = _flatness(finder.find(replace(frame, depth=depth)))
        except InputError:  # has no floor
            continue
        if flatness > best:
            best, words = flatness, reading
    return words


def ray_lengths(camera: Camera) -> Float64:
    """Distances (H, W) from the camera's centre of points whose depth is 1."""
    return np.asarray(np.linalg.norm(rays(camera), axis=-1))


def _readings(frame: Frame) -> Iterator[tuple[str, Float32]]:
    """What else the numbers may be, and the depth (H, W; m) that this makes."""
    lengths = ray_lengths(frame.camera)
    yield "distances from the camera's centre", (frame.depth / lengths).astype(np.float32)
    measured = frame.depth > 0
    if np.max(frame.depth) <= 1:  # of a renderer; 1 is far away
        behind = np.where(measured & (frame.depth < 1), 1 - frame.depth.astype(np.float64), np.inf)
        depth = 1 / behind
        scale = float(np.median(frame.depth[measured]) / np.median(depth[depth > 0]))
        yield "values of a depth buffer", (scale * depth).astype(np.float32)


def _flatness(floor: Floor) -> float:
    return floor.share / max(floor.deviation, ROUNDING)
