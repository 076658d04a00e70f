"""How much of two solids is the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.core import rng as streams
from scenefw.perception.evidence.mesh_distances import MeshDistances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Float64, TriangleMesh

_PLACES = 40_000  # in the box about both: the IoU of half-full ones is good to 0.005


def best_solid_ious(meshes: Sequence[TriangleMesh], true: Sequence[TriangleMesh]) -> Float64:
    """Largest IoU (N,) of each of N closed meshes with any true one, 0 without any."""
    solids = [MeshDistances(mesh) for mesh in true]
    return np.array(
        [
            max((_iou(MeshDistances(mesh), solid) for solid in solids), default=0.0)
            for mesh in meshes
        ]
    )


def _iou(first: MeshDistances, second: MeshDistances) -> float:
    if (first.low > second.high).any() or (second.low > first.high).any():
        return 0.0
    low, high = np.minimum(first.low, second.low), np.maximum(first.high, second.high)
    places = streams.generator(0).uniform(low, high, (_PLACES, 3))
    one, other = first.inside(places), second.inside(places)
    union = (one | other).sum()
    return float((one & other).sum() / union) if union else 0.0
