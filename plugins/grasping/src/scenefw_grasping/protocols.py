"""What a gripper promises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from scenefw.core.types import Float64, SceneObject, TriangleMesh
from scenefw_grasping.grasps import Grasp, Lift, Ranking


class Grasping(Protocol):
    """Proposes grasps of the objects of a scene, and simulates them (group `grasping`)."""

    def rank(
        self,
        objects: Mapping[int, SceneObject],
        eye: Float64,
        obstacles: Sequence[TriangleMesh] = (),
    ) -> Ranking:
        """Grasps of all objects, the one that disturbs the others least first.

        Args:
            objects: by label, as they were seen or predicted.
            eye: (3,) position of the camera that saw them (m).
            obstacles: what the arm must not hit.
        """

    def lift(self, objects: Mapping[int, SceneObject], grasp: Grasp, *, film: bool = False) -> Lift:
        """What becomes of a grasp in a scene whose objects rest, which it need not come from."""
