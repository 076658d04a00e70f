"""Masks of objects without the gaps that a camera leaves in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage
from skimage.segmentation import watershed

from scenefw.core.geometry import inverse, transform_points
from scenefw.perception.observation.floor_noise import MAX_FLOOR_HEIGHT
from scenefw.perception.observation.points import MINORITY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Camera, Float64, Int32, ObjectEstimate


def without_holes(masks: Int32, heights: Float64) -> Int32:
    """Masks (H, W), 0 = none, with holes of wrong or missing depth filled.

    Shiny and overexposed surfaces have no depth, or one below the floor. Such pixels are taken to
    show an object that encloses them, by nine tenths of their border. A hole through which the
    floor is seen stays, and so does what reaches the end of the image.

    Args:
        masks: (H, W) ids of objects.
        heights: (H, W) of pixels above the floor (m), NaN = no depth.
    """
    holes, count = ndimage.label((masks == 0) & ~(heights > -MAX_FLOOR_HEIGHT))
    padded_labels = np.pad(np.where(holes > 0, 0, masks + 1), 1)  # 1: of no object
    padded_holes = np.pad(holes, 1)
    owners, borders = [], []
    for axis in (0, 1):
        for step in (1, -1):
            neighbours = np.roll(padded_labels, step, axis)
            on_border = (padded_holes > 0) & (neighbours > 0)
            borders.append(padded_holes[on_border])
            owners.append(neighbours[on_border])
    base = int(padded_labels.max()) + 1
    keys, lengths = np.unique(
        np.concatenate(borders).astype(np.int64) * base + np.concatenate(owners),
        return_counts=True,
    )
    pairs = np.stack(np.divmod(keys, base))
    total = np.bincount(pairs[0], lengths, minlength=count + 1)
    enclosed = (pairs[1] > 1) & (lengths >= (1 - MINORITY) * total[pairs[0]])
    filled = np.zeros(count + 1, dtype=masks.dtype)
    filled[pairs[0, enclosed]] = pairs[1, enclosed] - 1
    for end in (holes[0], holes[-1], holes[:, 0], holes[:, -1]):
        filled[end] = 0
    return np.where(holes > 0, filled[holes], masks)


def with_unmeasured_pixels(
    masks: Int32,
    unmeasured: NDArray[np.bool_],
    gradient: Float64,
    objects: Sequence[ObjectEstimate],
    camera: Camera,
) -> Int32:
    """Masks (H, W), 0 = none, of pixels without depth, too: a watershed of colour (Meyer 1994).

    What is black, shines or lies in the shadow of a projector has no depth, but its colour has
    edges. No object grows beyond the box in the image that its whole shape takes.

    Args:
        masks: (H, W) ids of objects.
        unmeasured: (H, W) pixels without depth.
        gradient: (H, W) of colour, as of `colour_gradient`.
        objects: whose masks these are.
        camera: of the image, in the world frame of the objects.
    """
    window = np.zeros(masks.shape, dtype=bool)
    boxes = {item.id: _image_box(item.mesh.vertices, camera) for item in objects}
    for rows, columns in boxes.values():
        window[rows, columns] = True
    if not (window & unmeasured).any():
        return masks
    crop = ndimage.find_objects(window.astype(np.int8))[0]
    gaps = unmeasured[crop] & (masks[crop] == 0)
    markers = np.where(gaps, 0, masks[crop] + 1)
    labels = np.zeros_like(masks)
    labels[crop] = watershed(gradient[crop], markers, mask=ndimage.binary_dilation(gaps))
    filled = masks.copy()
    for label, box in boxes.items():
        filled[box][(labels[box] == label + 1) & (masks[box] == 0) & unmeasured[box]] = label
    return filled


def _image_box(points: Float64, camera: Camera) -> tuple[slice, slice]:
    """Rows and columns that world points (N, 3) before a camera take; none if one is behind it."""
    x, y, z = transform_points(inverse(camera.T_world_camera), points).T
    if (z <= 0).any():
        return slice(0), slice(0)
    sides = []
    for pixels in (camera.fy * y / z + camera.cy, camera.fx * x / z + camera.cx):
        start, stop = np.ceil(pixels.min()), np.floor(pixels.max()) + 1
        sides.append(slice(max(int(start), 0), max(int(stop), 0)))
    return sides[0], sides[1]
