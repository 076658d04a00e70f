"""Pixels between two surfaces, whose depth belongs to neither."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import binary_dilation, binary_opening, maximum_filter1d

from scenefw.perception.observation.pixels import WIDTH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Int32

    Mask = NDArray[np.bool_]

_REACH = 3  # pixels, of an image 640 wide
_STEEPEST = 15.0  # degrees
_OF_FLOOR = 0.7  # of the angle at which the camera looks onto the floor
_WIDEST, _JUMP = 20, 0.03  # pixels of a ramp, of an image 640 wide; m, of the ends of surfaces
_RAMP = 2 / 3  # of a part's pixels


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
    away = np.linalg.norm(rays, axis=-1)
    found = np.zeros(away.shape, dtype=bool)
    rays /= away[..., None]
    reach = max(1, round(_REACH * points.shape[1] / WIDTH))
    onto_floor = np.degrees(np.arcsin(np.clip(-rays[..., 2], 0, 1)))
    limit = np.tan(np.radians(np.minimum(_STEEPEST, _OF_FLOOR * onto_floor)))
    for axis in (0, 1):
        sides = _slopes(rays, away, axis, reach)
        with np.errstate(invalid="ignore"):
            less, more = (limit * one(*sides) > 1 for one in (np.fmin, np.fmax))
        less &= ~_on_surface(less, away, axis, round(_WIDEST * points.shape[1] / WIDTH))
        found |= binary_dilation(less, iterations=reach, mask=more)
    return found


def without_ramps(parts: Int32, mixed: Mask) -> Int32:
    """Parts (H, W) but for those of whose pixels more than two thirds are mixed."""
    pixels = np.maximum(np.bincount(parts.ravel()), 1)
    ramps = np.bincount(parts.ravel(), mixed.ravel()) > _RAMP * pixels
    return np.where(ramps[parts], 0, parts).astype(np.int32)


def _on_surface(steep: Mask, away: Float64, axis: int, width: int) -> Mask:
    """Steep pixels (H, W) of a surface: it is wider than a ramp, or ends where depth jumps.

    The farther end of a ramp meets what is behind it; that of a surface doesn't.
    """
    jump = _JUMP * WIDTH / away.shape[1]
    line = np.ones((width, 1) if axis == 0 else (1, width), dtype=bool)
    step = np.nan_to_num(np.diff(away, axis=axis, append=np.nan), nan=0.0)
    ahead = maximum_filter1d((step > jump).astype(np.uint8), width, axis, origin=-(width // 2))
    behind = maximum_filter1d((step < -jump).astype(np.uint8), width, axis, origin=(width - 1) // 2)
    rises = np.roll(away, -1, axis) > np.roll(away, 1, axis)
    return np.asarray(binary_opening(steep, line) | (np.where(rises, ahead, behind) > 0))


def _slopes(rays: Float64, away: Float64, axis: int, reach: int) -> tuple[Float64, Float64]:
    """Change of distance by way across the view (H, W), before each pixel and after it."""
    later, earlier = (
        tuple(one if a == axis else slice(None) for a in (0, 1))
        for one in (slice(reach, None), slice(None, -reach))
    )
    before, after = np.full_like(away, np.nan), np.full_like(away, np.nan)
    across = np.linalg.norm(rays[later] - rays[earlier], axis=-1)
    change = np.abs(away[later] - away[earlier])
    after[earlier] = change / (across * away[earlier])
    before[later] = change / (across * away[later])
    return before, after
