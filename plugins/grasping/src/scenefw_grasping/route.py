"""Grasps as an answer of the service (`run=serve`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from scenefw_grasping.protocols import Grasping
from scenefw_grasping.task import rank, summarise_grasps
from scenefw_simulators.body_maker import BodyMaker

if TYPE_CHECKING:
    from scenefw_serving.image_request import ImageRequest


class GraspRoute:
    """Answers with `grasps.json` of `run=grasp`.

    Args:
        grasping: proposes grasps and simulates them.
        bodies: makes rigid bodies of the objects.
    """

    path = "/grasp"
    summary = "Suction grasps of the objects of a depth image, the least disturbing first"
    formats: Mapping[str, str] = {"json": "application/json"}

    def __init__(self, grasping: Grasping, bodies: BodyMaker) -> None:
        self.grasping, self.bodies = grasping, bodies

    def answer(self, image: ImageRequest, form: str) -> bytes | Mapping[str, Any]:
        """Ranked grasps of a scene.

        Raises:
            InputError: the image is unusable.
            MissingDependencyError: the simulator is not installed.
        """
        scene = image.scene()
        return summarise_grasps(scene, rank(scene, self.grasping, self.bodies))
