"""Noise of camera tracking: every frame is fused from a pose that is a little wrong."""

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from scenefw.core import geometry
from scenefw.core.errors import ConfigError
from scenefw.core.types import Camera, CameraBatch


class Jitter:
    """Moves and turns each camera by independent Gaussian amounts (thesis 4.8.6).

    The depth image stays as it is: what is wrong is where fusion believes it was taken.

    Args:
        sigma: standard deviation of the camera's position along each axis (m).
        rotation: standard deviation of its rotation about each axis (rad); None = sigma / reach.
        reach: distance at which a rotation moves points about as far as the translation does (m).
    """

    def __init__(
        self, sigma: float = 0.001, rotation: float | None = None, reach: float = 0.3
    ) -> None:
        for name, value in (("sigma", sigma), ("rotation", rotation or 0.0)):
            if not value >= 0:
                raise ConfigError(
                    f"pose noise has {name} = {value}; expected 0 or more (sigma in metres: 0.001 "
                    "is 1 mm, rotation in radians)"
                )
        if not reach > 0:
            raise ConfigError(f"pose noise has reach = {reach}; expected metres above 0")
        self.sigma = sigma
        self.rotation = sigma / reach if rotation is None else rotation

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """The depth images (B, H, W) themselves: their pixels are right."""
        return depth

    def move(self, camera: Camera, generator: torch.Generator) -> Camera:
        """The camera where tracking believes it to be.

        Args:
            camera: with its true pose.
            generator: on the CPU; the same draw, whatever the amounts.
        """
        draw = torch.randn(6, generator=generator, dtype=torch.float64).numpy()
        if self.sigma == 0 and self.rotation == 0:
            return camera
        turn = Rotation.from_rotvec(self.rotation * draw[3:]).as_matrix()
        pose = np.asarray(camera.T_world_camera)
        return camera.moved(
            geometry.rigid(pose[:3, :3] @ turn, pose[:3, 3] + self.sigma * draw[:3])
        )
