"""Segments of which several rough volumes have a large share, divided among these."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.perception.segmentation.regions import grown

if TYPE_CHECKING:
    from scenefw.core.types import Float32, Int32


def divide(objects: Int32, shown: Int32, share: float, depth: Float32) -> Int32:
    """Objects (H, W) of which several instances (H, W) have a large share become several.

    Args:
        objects: labels, 0 = none.
        shown: instance that a pixel shows, 0 = none.
        share: of an object's pixels from which on an instance is large.
        depth: (H, W) metres.
    """
    found, unused = objects.copy(), int(objects.max(initial=0)) + 1
    for label in range(1, unused):
        own = objects == label
        votes = np.bincount(shown[own], minlength=1)
        votes[0] = 0
        large = np.flatnonzero(votes >= max(share * own.sum(), 1))
        if len(large) < 2:
            continue
        pieces = np.zeros_like(objects)
        for number, instance in enumerate(large[1:], start=unused):
            pieces[own & (shown == instance)] = number
        pieces[own & (shown == large[0])] = label
        found[own] = grown(pieces, own, depth)[own]
        found[own & (found == 0)] = label
        unused += len(large) - 1
    return found
