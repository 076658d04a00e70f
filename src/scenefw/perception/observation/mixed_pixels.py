"""Pixels between two surfaces, whose depth belongs to neither."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import binary_dilation, binary_opening, maximum_filter1d

from scenefw.perception.observation.components import EDGE
from scenefw.perception.observation.pixels import BLUR, REACH, WIDTH, scaled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Int32

    Mask = NDArray[np.bool_]

_MAX_GRAZING_ANGLE = 15.0  # degrees between a ray and a ramp
_MAX_FLOOR_ANGLE_RATIO = 0.7  # of the angle at which the camera looks onto the floor
_MIN_RAMP_RATIO = 0.67  # of a part's pixels: sides of objects are steep, too


def mixed_pixels(points: Float64, eye: Float64) -> Mask:
    """Pixels (H, W) of ramps of depth along which the camera looks.

    A stereo camera matches windows. Where one holds an object and what is behind it, its depth lies
    between the two, and a ramp goes from the edge of the object to the floor behind. Taken for
    points of the object, ramps would make it long, away from the camera. Real surfaces are rarely
    seen at such angles, and then badly.

    A jump from one pixel to the next is no ramp: depth has to change on both sides of a pixel. Nor
    is a surface that is wider than windows are, or ends in a jump: a ramp leads to what is behind.
    The ends of a ramp, where depth changes on one side alone, belong to it. Where the camera looks
    along the floor, tops of boxes are as steep, so the limit is lower there.

    Args:
        points: (H, W, 3) of the pixels, world coordinates, floor z = 0 (m), NaN = no depth.
        eye: (3,) where the camera is (m).
    """
    rays = points - eye
    distances = np.linalg.norm(rays, axis=-1)
    mixed = np.zeros(distances.shape, dtype=bool)
    rays /= distances[..., None]
    reach = scaled(BLUR, points.shape[1])
    floor_angle = np.degrees(np.arcsin(np.clip(-rays[..., 2], 0, 1)))
    limit = np.tan(np.radians(np.minimum(_MAX_GRAZING_ANGLE, _MAX_FLOOR_ANGLE_RATIO * floor_angle)))
    for axis in (0, 1):
        sides = _slopes(rays, distances, axis, reach)
        with np.errstate(invalid="ignore"):
            steep, steep_or_end = (
                limit * reduction(*sides) > 1 for reduction in (np.fmin, np.fmax)
            )
        steep &= ~_on_surface(steep, distances, axis, scaled(REACH, points.shape[1]))
        mixed |= binary_dilation(steep, iterations=reach, mask=steep_or_end)
    return mixed


def without_ramps(parts: Int32, mixed: Mask) -> Int32:
    """Parts (H, W) but for those of whose pixels more than two thirds are mixed."""
    pixels = np.maximum(np.bincount(parts.ravel()), 1)
    ramps = np.bincount(parts.ravel(), mixed.ravel()) > _MIN_RAMP_RATIO * pixels
    return np.where(ramps[parts], 0, parts).astype(np.int32)


def _on_surface(steep: Mask, distances: Float64, axis: int, width: int) -> Mask:
    """Steep pixels (H, W) of a surface: it is wider than a ramp, or ends where depth jumps.

    The farther end of a ramp meets what is behind it; that of a surface doesn't.
    """
    jump = EDGE * WIDTH / distances.shape[1]
    line = np.ones((width, 1) if axis == 0 else (1, width), dtype=bool)
    steps = np.nan_to_num(np.diff(distances, axis=axis, append=np.nan), nan=0.0)
    jump_ahead = maximum_filter1d(
        (steps > jump).astype(np.uint8), width, axis, origin=-(width // 2)
    )
    jump_behind = maximum_filter1d(
        (steps < -jump).astype(np.uint8), width, axis, origin=(width - 1) // 2
    )
    rises = np.roll(distances, -1, axis) > np.roll(distances, 1, axis)
    return np.asarray(binary_opening(steep, line) | (np.where(rises, jump_ahead, jump_behind) > 0))


def _slopes(rays: Float64, distances: Float64, axis: int, reach: int) -> tuple[Float64, Float64]:
    """Change of distance by way across the view (H, W), before each pixel and after it."""
    later, earlier = (
        tuple(span if a == axis else slice(None) for a in (0, 1))
        for span in (slice(reach, None), slice(None, -reach))
    )
    before, after = np.full_like(distances, np.nan), np.full_like(distances, np.nan)
    across = np.linalg.norm(rays[later] - rays[earlier], axis=-1)
    change = np.abs(distances[later] - distances[earlier])
    after[earlier] = change / (across * distances[earlier])
    before[later] = change / (across * distances[later])
    return before, after
