"""Images of rolled cameras, turned by quarters so that up is up, as networks have seen images."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from scenefw.core.types import Camera
from scenefw.perception.observation.points import MINORITY

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.floors import Floor
    from scenefw.core.types import Frame

Pixel = TypeVar("Pixel", bound=np.generic)


def quarter_turns(floor: Floor) -> int:
    """How often an image must be turned left by a quarter, 0 to 3, until its floor is below."""
    right, down = floor.normal[:2]
    if np.hypot(right, down) < MINORITY:  # straight down, no side is up
        return 0
    return round(float(np.arctan2(right, -down)) / (np.pi / 2)) % 4


def turned(frame: Frame, turns: int) -> Frame:
    """A frame turned left by quarters, its camera with it; what it shows stays where it is."""
    colour, labels = frame.colour, frame.labels
    return replace(
        frame,
        depth=turned_pixels(frame.depth, turns),
        colour=None if colour is None else turned_pixels(colour, turns),
        labels=None if labels is None else turned_pixels(labels, turns),
        camera=turned_camera(frame.camera, turns),
    )


def turned_pixels(pixels: NDArray[Pixel], turns: int) -> NDArray[Pixel]:
    """Values (H, W, ...) of an image turned left by quarters, contiguous in memory."""
    return np.ascontiguousarray(np.rot90(pixels, turns))


def turned_camera(camera: Camera, turns: int) -> Camera:
    """The camera of an image that is turned left by quarters."""
    for _ in range(turns % 4):
        pose = camera.T_world_camera.copy()
        pose[:3, 0], pose[:3, 1] = camera.T_world_camera[:3, 1], -camera.T_world_camera[:3, 0]
        camera = Camera(
            camera.height,
            camera.width,
            camera.fy,
            camera.fx,
            camera.cy,
            camera.width - 1 - camera.cx,
            pose,
        )
    return camera
