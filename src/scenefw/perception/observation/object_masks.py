"""Objects that somebody has marked in an image, each of which comes back or is told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import find_objects
from scipy.spatial import ConvexHull, QhullError

from scenefw.core.errors import InputError
from scenefw.fitting.placed import OUTLIERS
from scenefw.perception.observation.points import MINORITY, points_by_label, world_points
from scenefw.shapes.hulls import hull_mesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64, GridSpec, Int32, TriangleMesh
    from scenefw.perception.observation.workspace import Workspace

    Mask = NDArray[np.bool_]

MAX_ID = int(np.iinfo(np.uint16).max)
"""Of an object: `masks.png` of a result has 16 bits."""


@dataclass(frozen=True, eq=False)
class ObjectMasks:
    """Which pixels show objects that somebody has marked.

    Args:
        pixels: (H, W) numbers 1..N of the objects that come back, 0 = none.
        ids: what they are called, in the order of their numbers.
        warnings: why others don't come back, one line each.
    """

    pixels: Int32
    ids: tuple[int, ...]
    warnings: tuple[str, ...]


def object_masks(mask: Int32, workspace: Workspace, grid: GridSpec, noise: float) -> ObjectMasks:
    """The marked objects that are in the cube.

    Pixels on the floor beside an object, as masks have them, aren't its. But if most of an object
    is too low for the workspace, and clearly above the floor, all of that is its: a pen, a phone.

    Args:
        mask: (H, W) ids, 0 = none.
        workspace: in which they stand.
        grid: the cube.
        noise: standard deviation of the floor's heights (m).

    Raises:
        InputError: an id is larger than 65535.
    """
    pixels, numbers, warnings = np.zeros_like(mask), [], []
    points = world_points(workspace.frame)
    if mask.max(initial=0) > MAX_ID:
        raise InputError(f"the masks have an object {mask.max()}; give ids of 1 to {MAX_ID}")
    for label, box in enumerate(find_objects(mask), start=1):
        if box is None:
            continue
        shown, raised = mask[box] == label, workspace.objects[box]
        visible, reason = _visible(shown, points[box], raised, grid, noise)
        if not reason and footprint_hull(points[box][visible]) is None:
            reason = f"its {visible.sum()} pixels with depth are too few, or in one line"
        if reason:
            warnings.append(f"object {label} of the masks is left out: {reason}")
            continue
        numbers.append(label)
        pixels[box][visible] = len(numbers)
    return ObjectMasks(pixels, tuple(numbers), tuple(warnings))


def _visible(
    shown: Mask, points: Float64, raised: Mask, grid: GridSpec, noise: float
) -> tuple[Mask, str]:
    """Pixels (H, W) of an object, and why there are none."""
    measured = shown & np.isfinite(points[..., 2])
    if not measured.any():
        return measured, f"none of its {shown.sum()} pixels has a usable depth"
    voxels = grid.to_voxels(np.where(measured[..., None], points, 0.0))
    inside = measured & (voxels > -0.5).all(axis=-1) & (voxels < grid.resolution - 0.5).all(axis=-1)
    above = inside & (points[..., 2] > 0)
    high, low = shown & raised, inside & ~raised
    is_low = high.sum() < low.sum() and np.median(points[low][:, 2]) > OUTLIERS * noise
    if is_low and above.any():
        return above, ""
    if high.sum() > MINORITY * low.sum():
        return high, ""
    if inside.any():
        height = np.median(points[inside][:, 2]) * 1000
        return above, f"it is not above the floor ({height:.0f} mm in the middle)"
    middle = np.median(points[measured], axis=0)
    return above, (
        f"it is at x, y, z = ({middle[0]:.2f}, {middle[1]:.2f}, {middle[2]:.2f}) m, outside the "
        f"cube of {grid.extent:g} m about the others; give it a mask of its own"
    )


def footprint_hulls(masks: Int32, points: Float64) -> dict[int, TriangleMesh]:
    """The `footprint_hull` of each object that has one, by its label.

    Args:
        masks: (H, W) labels, 0 = none.
        points: (H, W, 3) of the pixels (m), finite where there is an object.
    """
    hulls = {
        label: footprint_hull(places) for label, places in points_by_label(masks, points).items()
    }
    return {label: hull for label, hull in hulls.items() if hull is not None}


def footprint_hull(points: Float64) -> TriangleMesh | None:
    """The convex hull of points (N, 3) and of their footprints on z = 0; None if it is flat."""
    try:
        outline = points[ConvexHull(points[:, :2]).vertices]
        return hull_mesh(np.concatenate([points, outline * (1, 1, 0)]))
    except (QhullError, ValueError):  # all points in a plane, or none
        return None
