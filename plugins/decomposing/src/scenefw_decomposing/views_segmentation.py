"""Objects that each of several views shows by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scenefw.core.types import Int32
    from scenefw.perception.observation.views import Views
    from scenefw.perception.steps import Grouping, Segmentation


@dataclass(frozen=True, eq=False)
class ViewsSegmentation:
    """Segments and groups each view by itself; no number is in two views.

    Args:
        segmentation: finds segments of one view.
        grouping: says which segments of one view are one object.
    """

    segmentation: Segmentation
    grouping: Grouping

    def segment(self, view: Views) -> Int32:
        """Objects of the views (V H, W), 0 = none, one view below the other."""
        images, count = [], 0
        for observation in view.observations:
            segments = self.segmentation.segment(observation)
            objects = self.grouping.group(segments, observation).pixels
            labels, numbers = np.unique(objects, return_inverse=True)
            first = int(labels[0] > 0) if len(labels) else 0  # 0 unless all pixels show objects
            numbers = numbers.reshape(objects.shape) + first
            images.append(np.where(numbers > 0, numbers + count, 0).astype(np.int32))
            count += int(numbers.max(initial=0))
        return np.concatenate(images)
