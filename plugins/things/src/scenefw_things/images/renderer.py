"""Images of scenes of things: depth, colour, and which thing and which class each pixel shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenefw.core.types import Camera, Float32
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_things.scenes.geometry import geometry, lifted
from scenefw_things.scenes.scene import BACKGROUND, OBJECT, ThingScene


@dataclass(frozen=True)
class ThingImage:
    """What a camera sees of a scene.

    Args:
        camera: in the scene's world.
        depth: (H, W) z-depth in metres, 0 = nothing.
        labels: (H, W) int32 number of the item from 1 on, 0 = the ground, or nothing.
        classes: (H, W) uint8 BACKGROUND, SUPPORT, OBSTACLE or OBJECT.
        colour: (H, W, 3) uint8.
    """

    camera: Camera
    depth: Float32
    labels: NDArray[np.int32]
    classes: NDArray[np.uint8]
    colour: NDArray[np.uint8]

    @property
    def instances(self) -> NDArray[np.int32]:
        """(H, W) numbers of things alone, 0 elsewhere."""
        return np.where(self.classes == OBJECT, self.labels, 0).astype(np.int32)


class ThingRenderer:
    """Casts rays at scenes of things (`renderers.mesh_raycaster`).

    Args:
        contrast: difference of colour from which a pixel gets more rays; 1 = never.
        max_depth: what is farther is not measured (m).
        device: where rays are cast.

    Raises:
        ConfigError: a negative contrast.
    """

    def __init__(self, contrast: float = 0.1, max_depth: float = 6.0, device: str = "cpu") -> None:
        self.caster = MeshRaycaster(contrast, device)
        self.max_depth = max_depth

    def images(self, scene: ThingScene, cameras: list[Camera]) -> list[ThingImage]:
        """One image per camera."""
        roles = scene.roles
        frames = self.caster.frames(geometry(scene), [lifted(camera, scene) for camera in cameras])
        images = []
        for frame, camera in zip(frames, cameras, strict=True):
            depth, ids = np.asarray(frame.depth, dtype=np.float32), np.asarray(frame.labels)
            visible = (depth > 0) & (depth <= self.max_depth)
            labels = np.where(visible, np.maximum(ids, 0), 0).astype(np.int32)
            classes = np.where(visible, roles[labels], BACKGROUND).astype(np.uint8)
            images.append(
                ThingImage(camera, np.where(visible, depth, np.float32(0)), labels, classes,
                           np.asarray(frame.colour))
            )  # fmt: skip
        return images
