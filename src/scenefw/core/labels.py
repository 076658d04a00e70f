"""Labels of height maps: which are unknown, where they come from, how they get onto a map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenefw.core.height_maps import HeightMap
from scenefw.core.types import Float32

UNKNOWN = -1
"""Label of pixels and vertices that count neither in training nor in evaluation."""

NO_SOURCE, FROM_VIEWS, FROM_MAP, FROM_BOTH = 0, 1, 2, 3
"""Values of `HeightMap.sources`."""

Sources = NDArray[np.uint8]

_TOLERANCE = 1e-6  # float32 probabilities this close to uniform count as uniform


def known_mask(probabilities: Float32) -> NDArray[np.bool_]:
    """(V, V) where probabilities (C, V, V) are not uniform."""
    return np.asarray(probabilities.max(axis=0) > 1 / len(probabilities) + _TOLERANCE)


def labelled(
    height_map: HeightMap, probabilities: Float32, classes: Sequence[str], sources: Sources | int
) -> HeightMap:
    """The map with the most probable class of each vertex that has a height and is known.

    Args:
        height_map: without labels.
        probabilities: (C, V, V).
        classes: their names.
        sources: where labels come from, (V, V) or one for all.
    """
    named = height_map.seen & known_mask(probabilities)
    labels = np.where(named, probabilities.argmax(axis=0), UNKNOWN).astype(np.int32)
    origin = np.where(named, sources, NO_SOURCE).astype(np.uint8)
    return replace(
        height_map,
        probabilities=probabilities,
        labels=labels,
        sources=origin,
        classes=tuple(classes),
    )


def unlabelled(height_map: HeightMap, classes: Sequence[str]) -> HeightMap:
    """The map with every vertex unknown."""
    shape = (len(classes), *height_map.grid.shape)
    uniform = np.full(shape, 1 / len(classes), np.float32)
    return labelled(height_map, uniform, classes, NO_SOURCE)
