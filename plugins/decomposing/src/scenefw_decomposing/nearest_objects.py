"""Which object's surface points lie nearest to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.perception.evidence.mesh_distances import distances_to

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Float64, Int32, ObjectEstimate


def nearest_objects(
    points: Float64, objects: Sequence[ObjectEstimate], reach: float
) -> tuple[Int32, Float64]:
    """Ids (N,) of the objects whose surface is nearest to points, and how far away it is (m).

    Args:
        points: (N, 3) world coordinates (m).
        objects: with closed meshes.
        reach: farther from a surface a point is nobody's: id 0, distance infinite (m).
    """
    labels = np.zeros(len(points), np.int32)
    nearest = np.full(len(points), np.inf)
    for item in objects:
        distances = distances_to(item.mesh)
        box = (points > distances.low - reach) & (points < distances.high + reach)
        rows = np.flatnonzero(box.all(axis=1))
        gaps = np.abs(distances.at(points[rows]))
        closer = (gaps < nearest[rows]) & (gaps <= reach)
        labels[rows[closer]], nearest[rows[closer]] = item.id, gaps[closer]
    return labels, nearest


def explained_shares(
    points: Float64, objects: Sequence[ObjectEstimate], inlier_distance: float, reach: float
) -> dict[int, float]:
    """Of seen points that are an object's, the share that lies on its surface, by id.

    Args:
        points: (N, 3) world coordinates (m), without the floor.
        objects: with closed meshes.
        inlier_distance: a point lies on a surface up to this far from it (m).
        reach: a point is the nearest object's up to this far from it (m).
    """
    labels, distances = nearest_objects(points, objects, reach)
    shares = {}
    for item in objects:
        gaps = distances[labels == item.id]
        shares[item.id] = float((gaps < inlier_distance).mean()) if len(gaps) else 0.0
    return shares
