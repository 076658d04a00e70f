"""How far hypotheses differ at each point of a surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from scenefw.perception.evidence.mesh_distances import distances_to
from scenefw.perception.observation.points import SAMPLE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Float32, ObjectEstimate, SceneEstimate


def surface_spread(
    estimate: SceneEstimate, alternatives: Sequence[SceneEstimate]
) -> dict[int, Float32]:
    """Of each object, by id, how far each vertex (V,) lies from its surface elsewhere (m).

    The root mean square over the alternatives that hold the object. What was measured has about
    the spread of the sensor's noise, what nobody saw more; a planner may keep off by a multiple.

    Args:
        estimate: the scene.
        alternatives: other hypotheses of it, in which an object has the same id. An object that
            none of them holds is left out.
    """
    spreads = {}
    for item in estimate.objects:
        rivals = [o for scene in alternatives for o in scene.objects if o.id == item.id]
        if rivals:
            spreads[item.id] = _spread(item, rivals)
    return spreads


def _spread(item: ObjectEstimate, rivals: Sequence[ObjectEstimate]) -> Float32:
    vertices = item.mesh.vertices
    places = vertices[:: -(-len(vertices) // SAMPLE)]
    squares = [distances_to(other.mesh).at(places) ** 2 for other in rivals]
    spread = np.sqrt(np.mean(squares, axis=0)).astype(np.float32)
    return np.asarray(spread[cKDTree(places).query(vertices)[1]])
