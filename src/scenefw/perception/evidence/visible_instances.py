"""Which instance of a volume each pixel of a depth image shows."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, find_objects, map_coordinates

from scenefw.core.geometry import within
from scenefw.core.types import Float64, GridSpec, Int32


def visible_instances(
    instances: Int32,
    points: Float64,
    grid: GridSpec,
    pixel_mask: NDArray[np.bool_],
    reach: float = 2.0,
) -> Int32:
    """Instance labels (H, W) of pixels at their 3D points, 0 = no object.

    A pixel shows the instance whose signed distance at its point is least, if that is below
    `reach`, so that borders come from the image and not from the silhouettes of voxels.

    Args:
        instances: (X, Y, Z) labels.
        points: (H, W, 3) world coordinates (m), NaN = no depth.
        grid: of the volume.
        pixel_mask: (H, W) pixels that may show one.
        reach: how far outside an object a seen point may lie and still be its (voxels).
    """
    voxels = grid.to_voxels(points)
    with np.errstate(invalid="ignore"):
        inside = within(voxels, (-0.5,) * 3, (grid.resolution - 0.5,) * 3)
    selection = inside & pixel_mask
    labels = np.zeros(selection.shape, np.int32)
    labels[selection] = _nearest_instances(instances, voxels[selection], reach)
    return labels


def _nearest_instances(instances: Int32, voxels: Float64, reach: float) -> Int32:
    """Instance (K,) of least signed distance at voxel coordinates (K, 3), 0 beyond reach."""
    nearest, label = np.full(len(voxels), reach), np.zeros(len(voxels), np.int32)
    for number, box in enumerate(find_objects(instances), start=1):
        if box is None:
            continue
        # Beyond a box as wide as the reach no point can be the instance's
        room = int(np.ceil(reach)) + 1
        ends = [
            (max(s.start - room, 0), min(s.stop + room, n))
            for s, n in zip(box, instances.shape, strict=True)
        ]
        low, high = np.transpose(ends)
        indices = np.flatnonzero(within(voxels, low - 0.5, high - 0.5))
        inside = np.pad(instances[tuple(slice(*e) for e in ends)] == number, 1, mode="edge")
        field = distance_transform_edt(~inside) - distance_transform_edt(inside)
        distance = map_coordinates(field, (voxels[indices] - low + 1).T, order=1, mode="nearest")
        closer = distance < nearest[indices]
        nearest[indices[closer]], label[indices[closer]] = distance[closer], number
    return label
