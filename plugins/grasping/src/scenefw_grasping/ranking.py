"""Suction grasps ranked by how far a simulation says the other objects move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from scenefw.core.geometry import inverse
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.core.types import Float64, SceneObject, TriangleMesh
from scenefw_grasping.candidates import SuctionCandidates
from scenefw_grasping.grasps import Grasp, Lift, RankedGrasp, Ranking
from scenefw_grasping.lifting import LiftSimulation
from scenefw_simulators.motions import motions


class SuctionGrasping:
    """Proposes grasps with a suction cup, and simulates each in the scene as it was predicted.

    The objects come to rest first, as predictions float and overlap by millimetres. Grasps follow
    their objects there.

    Args:
        candidates: where the cup could hold.
        lifting: simulates.
        contacts: of each object that are simulated.
        settle: steps at most in which the objects come to rest first.
        alike: disturbances that differ by less count as the same, and the better seal wins (m).

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        candidates: SuctionCandidates,
        lifting: LiftSimulation,
        contacts: int = 4,
        settle: int = 2400,
        alike: float = 0.001,
    ) -> None:
        COUNT.require(contacts=contacts, settle=settle)
        POSITIVE.require(alike=alike)
        self.candidates, self.lifting = candidates, lifting
        self.contacts, self.settle, self.alike = contacts, settle, alike

    def rank(
        self,
        objects: Mapping[int, SceneObject],
        eye: Float64,
        obstacles: Sequence[TriangleMesh] = (),
    ) -> Ranking:
        """Grasps of all objects, the one that disturbs the others least first."""
        if not objects:
            return Ranking((), {}, {})
        resting = self._rested(objects)
        left_out: dict[int, str] = {}
        ranked_grasps: list[RankedGrasp] = []
        for label, grasps in self.candidates.find(objects, eye).items():
            if isinstance(grasps, str):
                left_out[label] = grasps
                continue
            motion = resting[label].pose.matrix @ inverse(objects[label].pose.matrix)
            rehearsed = [grasp.moved(motion) for grasp in grasps]
            feasible_grasps = self.lifting.feasible(resting, rehearsed, self.contacts, obstacles)
            if not feasible_grasps:
                left_out[label] = "the arm reaches none of its contacts without touching something"
            inverse_motion = inverse(motion)
            for grasp in feasible_grasps:
                ranked_grasps.append(
                    RankedGrasp(grasp.moved(inverse_motion), grasp, self.lift(resting, grasp))
                )
        return Ranking(tuple(sorted(ranked_grasps, key=self._order)), left_out, resting)

    def lift(self, objects: Mapping[int, SceneObject], grasp: Grasp, *, film: bool = False) -> Lift:
        """What becomes of a grasp in a scene whose objects rest."""
        return self.lifting.lift(objects, grasp, film=film)

    def _rested(self, objects: Mapping[int, SceneObject]) -> dict[int, SceneObject]:
        ends = motions(list(objects.values()), self.lifting.engine, self.settle, until_rest=True)
        return {
            label: replace(item, pose=end.pose)
            for (label, item), end in zip(objects.items(), ends, strict=True)
        }

    def _order(self, ranked_grasp: RankedGrasp) -> tuple[bool, float, float]:
        rounded = float(np.floor(ranked_grasp.lift.disturbance / self.alike))
        wrong = not ranked_grasp.lift.lifted or ranked_grasp.lift.label != ranked_grasp.grasp.label
        return wrong, rounded, -ranked_grasp.grasp.seal
