"""What a prediction knows of its shapes without the truth, as numbers for their confidence."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import find_objects

from scenefw.metrics.sampling import face_areas
from scenefw.perception.evidence.object_depth import object_depth
from scenefw.perception.observation.floor_noise import ROUNDING
from scenefw.perception.observation.image_turns import turned_pixels
from scenefw.perception.observation.pixels import coarse_step
from scenefw.shapes.moments import moments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Camera, Float32, Float64, ObjectEstimate, SceneEstimate
    from scenefw.perception.evidence.object_depth import Box
    from scenefw.perception.observation.observation import Observation


class Trend(IntEnum):
    """Whether an object's expected IoU may only rise or only fall with a number."""

    RISES = 1
    FALLS = -1
    ANY = 0


CUES: Mapping[str, Trend] = {
    "agreement": Trend.RISES,  # mean IoU with the most similar object of each other hypothesis
    "silhouette": Trend.RISES,  # IoU of its mask with its outline, but for what is hidden
    "residual": Trend.FALLS,  # mean distance along rays of what is measured from its surface
    "free": Trend.FALLS,  # mean distance by which its outline stands before what is measured
    "occluded": Trend.FALLS,  # ratio of its outline that something nearer hides
    "noise": Trend.FALLS,  # standard deviation of depth
    "thickness": Trend.ANY,  # logarithm of its volume by surface (m)
    "fill": Trend.ANY,  # ratio of the box along its axes that it fills
    "hull": Trend.ANY,  # 1 if no shape explains it, so that it is a hull, voxels or columns
}
"""Numbers about an object.

Distances are square roots of multiples of its thickness, volume by surface: a shape that is off by
a small part of it all over has lost about as large a part of its volume.
"""
_MAX_RATIO = 3.0  # of distances to a thickness: with more, hardly any overlap is left


def shape_cues(
    estimate: SceneEstimate, view: Observation, agreement: Mapping[int, float]
) -> dict[int, dict[str, float]]:
    """The cues of each object, by id.

    Args:
        estimate: with masks, not turned back.
        view: with its image.
        agreement: by id; objects without one are the same in all hypotheses.
    """
    depth = view.depth
    if view.source is not None:
        depth = turned_pixels(view.source.depth, view.turns)
    masks = estimate.masks
    assert masks is not None
    sigma = float(np.median(view.noise.at(depth[depth > 0]))) if (depth > 0).any() else 0.0
    step = coarse_step(view.camera.width)
    depth, masks = depth[::step, ::step], masks[::step, ::step]
    boxes: dict[int, Box] = {
        label: box for label, box in enumerate(find_objects(masks), start=1) if box is not None
    }
    return {
        item.id: {"agreement": agreement.get(item.id, 1.0)}
        | _cues(item, view.camera, depth, masks == item.id, boxes.get(item.id), sigma)
        for item in estimate.objects
    }


def _cues(
    item: ObjectEstimate,
    camera: Camera,
    depth: Float32,
    mask: NDArray[np.bool_],
    mask_box: Box | None,
    sigma: float,
) -> dict[str, float]:
    volume, tiny = moments(item.mesh).volume, np.finfo(float).tiny
    thickness = max(volume / max(float(face_areas(item.mesh).sum()), tiny), ROUNDING)
    outline_depth = object_depth(item.mesh, camera)
    box = _union(outline_depth.box, mask_box)
    front = np.zeros(depth.shape)
    front[outline_depth.box] = outline_depth.front
    front, measured, shown = front[box], depth[box].astype(np.float64), mask[box]
    hit, valid = front > 0, measured > 0
    hides = hit & valid & ~shown & (measured < front)
    outline = hit & ~hides
    gaps = measured - front
    return {
        "silhouette": _ratio(outline & shown, outline | shown),
        "residual": _root(np.abs(gaps[outline & shown & valid]), thickness, nothing=_MAX_RATIO),
        "free": _root(np.maximum(gaps[outline & valid], 0), thickness, nothing=0.0),
        "occluded": _ratio(hides, hit),
        "noise": _root(np.array([sigma]), thickness, nothing=0.0),
        "thickness": float(np.log(thickness)),
        "fill": min(volume / max(float(np.prod(item.extents)), tiny), 1.0),
        "hull": float(item.placed is None),
    }


def _union(box: Box, other: Box | None) -> Box:
    """The smallest box about both; one without pixels, or None, adds nothing."""
    boxes = [b for b in (box, other) if b is not None and all(side.stop > side.start for side in b)]
    if not boxes:
        return box
    rows, columns = (
        slice(min(side.start for side in sides), max(side.stop for side in sides))
        for sides in zip(*boxes, strict=True)
    )
    return rows, columns


def _ratio(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
    return float(part.sum() / whole.sum()) if whole.any() else 0.0


def _root(distances: Float64, thickness: float, nothing: float) -> float:
    """Square root of the mean distance (m) by thickness; `nothing` is the ratio without any."""
    ratio = float(distances.mean()) / thickness if len(distances) else nothing
    return float(np.sqrt(min(ratio, _MAX_RATIO)))
