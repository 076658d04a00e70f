"""Segments of which several rough volumes have a large share, divided among these."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.perception.segmentation.regions import grown

if TYPE_CHECKING:
    from scenefw.core.types import Float32, Int32


def divide(objects: Int32, pixel_instances: Int32, share: float, depth: Float32) -> Int32:
    """Objects (H, W) of which several instances (H, W) have a large share become several.

    Args:
        objects: labels, 0 = none.
        pixel_instances: instance that a pixel shows, 0 = none.
        share: of an object's pixels from which on an instance is large.
        depth: (H, W) metres.
    """
    labels, next_label = objects.copy(), int(objects.max(initial=0)) + 1
    for label in range(1, next_label):
        object_mask = objects == label
        votes = np.bincount(pixel_instances[object_mask], minlength=1)
        votes[0] = 0
        large_instances = np.flatnonzero(votes >= max(share * object_mask.sum(), 1))
        if len(large_instances) < 2:
            continue
        pieces = np.zeros_like(objects)
        for number, instance in enumerate(large_instances[1:], start=next_label):
            pieces[object_mask & (pixel_instances == instance)] = number
        pieces[object_mask & (pixel_instances == large_instances[0])] = label
        labels[object_mask] = grown(pieces, object_mask, depth)[object_mask]
        labels[object_mask & (labels == 0)] = label
        next_label += len(large_instances) - 1
    return labels
