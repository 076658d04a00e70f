"""Places just beside what is seen of an object, where the view looks past it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import golden
from scipy.ndimage import distance_transform_edt

from scenefw.perception.observation.components import TOUCH
from scenefw.perception.observation.floor import TABLE_HEIGHT
from scenefw.perception.observation.pixels import BLUR, REACH, WIDTH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64


def passed_places(mask: NDArray[np.bool_], points: Float64, eye: Float64, count: int) -> Float64:
    """Free places (K, 3) on rays that pass an object closely, K at most `count`, in metres.

    They are as far away as the object's edge beside them, or up to `TABLE_HEIGHT` further.
    Where something nearer hides what is there, or nothing was measured, a ray says nothing.

    Args:
        mask: (H, W) the object's pixels.
        points: (H, W, 3) world coordinates of all pixels (m), NaN = no depth.
        eye: (3,) where the camera is (m).
        count: of places.
    """
    if not mask.any() or count < 1:
        return np.empty((0, 3))
    min_distance, max_distance = (pixels * mask.shape[1] / WIDTH for pixels in (BLUR, REACH))
    box = box_about(mask, int(np.ceil(max_distance)) + 1)
    distances, (row, column) = distance_transform_edt(~mask[box], return_indices=True)
    ring = (distances >= max(min_distance, 1)) & (distances <= max(max_distance, 2))
    rays = points[box][ring] - eye
    edges = np.linalg.norm(points[box][row[ring], column[ring]] - eye, axis=1)
    depths = np.linalg.norm(rays, axis=1)
    with np.errstate(invalid="ignore"):
        candidates = np.flatnonzero(depths - TOUCH > edges)  # NaN isn't
    samples = candidates[:: -(-len(candidates) // count)] if len(candidates) else candidates
    share = np.modf(golden * np.arange(len(samples)))[0]  # even, and differs along the silhouette
    sample_depths = edges[samples] + share * np.minimum(
        depths[samples] - TOUCH - edges[samples], TABLE_HEIGHT
    )
    return np.asarray(
        eye + rays[samples] * (sample_depths / depths[samples])[:, None], dtype=np.float64
    )


def box_about(mask: NDArray[np.bool_], room: int) -> tuple[slice, slice]:
    """Rows and columns of what is marked (H, W), which is something, and `room` pixels beside."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return (
        slice(max(rows[0] - room, 0), rows[-1] + room + 1),
        slice(max(columns[0] - room, 0), columns[-1] + room + 1),
    )
