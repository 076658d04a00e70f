"""How far objects move when they are left to gravity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenefw.core.protocols import Engine
from scenefw.core.types import Pose, SceneObject


@dataclass(frozen=True)
class Motion:
    """Of one object.

    Args:
        pose: at the end.
        shift: how far its centre moved (m); infinite where the simulation lost it.
        turn: how far it turned (degrees), 0 to 180.
    """

    pose: Pose
    shift: float
    turn: float


def motions(
    objects: Sequence[SceneObject], engine: Engine, steps: int, *, until_rest: bool = False
) -> list[Motion]:
    """Motion of each object in `steps` steps of a world of its own.

    Args:
        objects: floating and intersecting ones too.
        engine: simulates them.
        steps: of the simulation.
        until_rest: ends it when everything rests.
    """
    engine.reset()
    handles = [engine.add(item) for item in objects]
    if handles and until_rest:
        engine.settle(steps)
    elif handles:
        engine.simulate(steps)
    ends = [engine.pose(handle) for handle in handles]
    return [_motion(item.pose, end) for item, end in zip(objects, ends, strict=True)]


def _motion(start: Pose, end: Pose) -> Motion:
    shift = float(np.linalg.norm(end.position - start.position))
    cosine = min(1.0, abs(float(start.quaternion @ end.quaternion)))
    if not np.isfinite([shift, cosine]).all():
        return Motion(start, float("inf"), 180.0)
    return Motion(end, shift, float(np.degrees(2 * np.arccos(cosine))))
