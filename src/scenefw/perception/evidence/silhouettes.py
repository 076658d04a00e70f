"""Places just beside what is seen of an object, where the view looks past it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import distance_transform_edt

from scenefw.perception.observation.pixels import WIDTH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64

_NEAREST, _FARTHEST = 3, 12  # pixels from the object
_BEHIND = 0.15  # m behind the object's edge: as far as places lie
_GAP = 0.01  # m before what is seen there
_GOLDEN = 0.6180339887498949  # multiples of it spread evenly, and differ along the silhouette


def passed_places(own: NDArray[np.bool_], points: Float64, eye: Float64, count: int) -> Float64:
    """Free places (K, 3) on rays that pass an object closely, K at most `count`, in metres.

    They are as far away as the object's edge beside them, or up to `_BEHIND` further. Where
    something nearer hides what is there, or nothing was measured, a ray says nothing.

    Args:
        own: (H, W) the object's pixels.
        points: (H, W, 3) world coordinates of all pixels (m), NaN = no depth.
        eye: (3,) where the camera is (m).
        count: of places.
    """
    if not own.any() or count < 1:
        return np.empty((0, 3))
    nearest, farthest = (pixels * own.shape[1] / WIDTH for pixels in (_NEAREST, _FARTHEST))
    box = box_about(own, int(np.ceil(farthest)) + 1)
    away, (row, column) = distance_transform_edt(~own[box], return_indices=True)
    ring = (away >= max(nearest, 1)) & (away <= max(farthest, 2))
    rays = points[box][ring] - eye
    edges = np.linalg.norm(points[box][row[ring], column[ring]] - eye, axis=1)
    seen = np.linalg.norm(rays, axis=1)
    with np.errstate(invalid="ignore"):
        past = np.flatnonzero(seen - _GAP > edges)  # NaN isn't
    some = past[:: -(-len(past) // count)] if len(past) else past
    share = np.modf(_GOLDEN * np.arange(len(some)))[0]
    far = edges[some] + share * np.minimum(seen[some] - _GAP - edges[some], _BEHIND)
    return np.asarray(eye + rays[some] * (far / seen[some])[:, None], dtype=np.float64)


def box_about(own: NDArray[np.bool_], room: int) -> tuple[slice, slice]:
    """Rows and columns of what is marked (H, W), which is something, and `room` pixels beside."""
    rows, columns = (np.flatnonzero(own.any(axis=axis)) for axis in (1, 0))
    return (
        slice(max(rows[0] - room, 0), rows[-1] + room + 1),
        slice(max(columns[0] - room, 0), columns[-1] + room + 1),
    )
