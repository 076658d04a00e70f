"""How far the objects of a scene move when they are left to gravity."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from scenefw_simulators.motions import motions

if TYPE_CHECKING:
    from scenefw.core.protocols import Engine
    from scenefw.core.types import SceneEstimate
    from scenefw_simulators.body_maker import BodyMaker


class Displacement(NamedTuple):
    """Of one scene.

    Args:
        mean: over objects (m); None where there is no object.
        left_out: objects that are no solid.
    """

    mean: float | None
    left_out: int


def displacement(
    scene: SceneEstimate, engine: Engine, bodies: BodyMaker, steps: int, furthest: float
) -> Displacement:
    """Simulates a scene until everything rests.

    Args:
        scene: as it is predicted; it stays so.
        engine: simulates.
        bodies: makes rigid bodies of the objects.
        steps: at most.
        furthest: an object counts as moved this far at most (m); so does one that is no solid.
    """
    meshes = {item.id: item.mesh for item in scene.objects}
    placed = {item.id: item.placed for item in scene.objects if item.placed is not None}
    solids = bodies.make(meshes, placed)
    body_motions = motions(list(solids.bodies.values()), engine, steps, until_rest=True)
    shifts = [min(motion.shift, furthest) for motion in body_motions] + [furthest] * len(
        solids.left_out
    )
    return Displacement(float(np.mean(shifts)) if shifts else None, len(solids.left_out))
