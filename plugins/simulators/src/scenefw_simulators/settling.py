"""Predicted objects come to rest under gravity, and how far each moves says how stable they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from scenefw.core.geometry import inverse
from scenefw.core.protocols import Engine
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.core.types import Float64, PlacedShape, SceneEstimate
from scenefw.perception.estimate.transforms import moved
from scenefw_simulators.body_maker import Bodies, BodyMaker
from scenefw_simulators.motions import Motion, motions


class PhysicalSettling:
    """Lets the objects of predicted scenes come to rest on the floor and on each other.

    An object that moves further than `furthest` was wrong from the start, or was hit by one that
    was: it stays as predicted, and so does one that is no solid. Details of the estimates say so,
    object by object, under `settled`.

    Args:
        engine: simulates.
        bodies: makes rigid bodies of the objects.
        steps: of the simulation at most; it ends when everything rests.
        furthest: an object that moves further stays as it was (m).
        steepest: objects of a stable scene turn by less (degrees).

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        engine: Engine,
        bodies: BodyMaker,
        steps: int = 2400,
        furthest: float = 0.2,
        steepest: float = 30.0,
    ) -> None:
        COUNT.require(steps=steps)
        POSITIVE.require(furthest=furthest, steepest=steepest)
        self.engine, self.bodies, self.steps = engine, bodies, steps
        self.furthest, self.steepest = furthest, steepest

    def settle(self, scenes: Sequence[SceneEstimate]) -> list[SceneEstimate]:
        """Scenes of one image with their objects at rest."""
        return [self._settle_scene(scene, number) for number, scene in enumerate(scenes, start=1)]

    def _settle_scene(self, scene: SceneEstimate, number: int) -> SceneEstimate:
        meshes = {item.id: item.mesh for item in scene.objects}
        placed: dict[int, PlacedShape] = {
            item.id: item.placed for item in scene.objects if item.placed is not None
        }
        bodies = self.bodies.make(meshes, placed)
        body_motions = motions(
            list(bodies.bodies.values()), self.engine, self.steps, until_rest=True
        )
        ends = dict(zip(bodies.bodies, body_motions, strict=True))
        accepted_motions = {
            label: motion for label, motion in ends.items() if motion.shift <= self.furthest
        }
        shifts = {
            label: _motion_matrix(bodies.bodies[label].pose.matrix, motion)
            for label, motion in accepted_motions.items()
        }
        facts = self._facts(bodies, ends) | {"hypothesis": number}
        settled_scene = moved(scene, shifts) if shifts else scene
        return replace(settled_scene, details={**scene.details, "settled": facts})

    def _facts(self, bodies: Bodies, ends: Mapping[int, Motion]) -> dict[str, Any]:
        rows = [self._row(bodies, label, motion) for label, motion in ends.items()]
        rows += [{"id": label, "stays": reason} for label, reason in bodies.left_out.items()]
        is_steady = [m.shift <= self.furthest and m.turn < self.steepest for m in ends.values()]
        facts: dict[str, Any] = {
            "objects": sorted(rows, key=lambda row: row["id"]),
            "displacement": float(np.mean([m.shift for m in ends.values()])) if ends else None,
            "stable": bool(ends) and all(is_steady),
        }
        return facts if ends else facts | {"reason": "there is no solid to settle"}

    def _row(self, bodies: Bodies, label: int, motion: Motion) -> dict[str, Any]:
        row = {
            "id": label,
            "moved": motion.shift,
            "turned": motion.turn,
            "collides_as": bodies.collides_as(label),
        }
        if motion.shift <= self.furthest:
            return row
        if not np.isfinite(motion.shift):
            return row | {"stays": "the simulation lost it"}
        return row | {"stays": f"it moved further than {self.furthest:g} m"}


def _motion_matrix(start: Float64, motion: Motion) -> Float64:
    return np.asarray(motion.pose.matrix @ inverse(start))
