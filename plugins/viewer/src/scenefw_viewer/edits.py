"""What somebody did to a predicted scene: objects taken away, put back and moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.geometry import inverse
from scenefw.perception.estimate.transforms import moved, without
from scenefw_editing.scene_editing import named

if TYPE_CHECKING:
    from scenefw.core.types import Float64, ObjectEstimate, SceneEstimate


class Edits:
    """A scene as predicted and what has changed since; nothing of it is lost.

    Args:
        scene: as predicted.
    """

    def __init__(self, scene: SceneEstimate) -> None:
        self.scene = scene
        self.removed: set[int] = set()
        self._motions: dict[int, Float64] = {}

    @property
    def ids(self) -> list[int]:
        """Of all objects, those that were taken away too."""
        return [item.id for item in self.scene.objects]

    @property
    def changed(self) -> bool:
        """Whether the scene differs from the prediction."""
        return bool(self.removed or self._motions)

    def item(self, label: int) -> ObjectEstimate:
        """An object as it was predicted."""
        return named(self.scene.objects, label)

    def remove(self, label: int) -> None:
        """Takes an object away."""
        self.removed.add(label)

    def put_back(self, label: int) -> None:
        """Brings an object back to where it was when it was taken away."""
        self.removed.discard(label)

    def place(self, label: int, pose: Float64) -> None:
        """Moves an object until its own pose is this one, 4x4 in world coordinates."""
        self._motions[label] = pose @ inverse(self.item(label).pose.matrix)

    def motion(self, label: int) -> Float64:
        """How an object was moved, rigid 4x4 in world coordinates."""
        return self._motions.get(label, np.eye(4))

    def pose(self, label: int) -> Float64:
        """4x4 pose of an object now, in world coordinates."""
        return self.motion(label) @ self.item(label).pose.matrix

    def undo(self) -> None:
        """Brings every object back to where it was predicted."""
        self.removed.clear()
        self._motions.clear()

    def result(self) -> SceneEstimate:
        """The scene as it is now: meshes, poses, shapes, volumes and masks."""
        scene = without(self.scene, self.removed) if self.removed else self.scene
        motions = {i: m for i, m in self._motions.items() if i not in self.removed}
        return moved(scene, motions) if motions else scene
