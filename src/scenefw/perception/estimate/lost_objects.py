"""What a prediction leaves out of what stands on the floor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.perception.observation.components import EDGE, depth_parts
from scenefw.perception.observation.doctor import NO_OBJECTS, place_in_words
from scenefw.perception.observation.object_groups import MAX_UNSAID_RATIO
from scenefw.perception.observation.points import MAJORITY

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Int32


def lost_objects(masks: Int32, standing: NDArray[np.bool_], depth: Float32) -> str | None:
    """One line about what became no object; None if it is little.

    A connected surface counts if masks cover no more than half of it: edges are often left out.

    Args:
        masks: (H, W) ids of objects, 0 = none.
        standing: (H, W) pixels of what stands on the floor.
        depth: (H, W) metres.
    """
    if not masks.any():
        return NO_OBJECTS.line
    surfaces = depth_parts(depth, standing, EDGE)
    sizes = np.bincount(surfaces.ravel())
    is_lost = np.bincount(surfaces.ravel(), masks.ravel() > 0) <= MAJORITY * sizes
    lost = standing & is_lost[surfaces]
    ratio = lost.sum() / max(standing.sum(), 1)
    if ratio <= MAX_UNSAID_RATIO:
        return None
    return (
        f"{ratio:.0%} of what stands on the floor became no object, most of it at the "
        f"{place_in_words(lost)} of the image; mark objects that are missing (run.masks)"
    )
