"""Random rigid motion of whole scenes on the floor."""

import math
from dataclasses import replace

import numpy as np
import torch

from scenefw.core.errors import ConfigError
from scenefw.core.types import SceneParameters


class RigidAugmentation:
    """Turns a scene about the z axis and shifts it on the floor (thesis 5.2.1).

    Args:
        rotation: angles are drawn uniformly from +-rotation (radians); pi gives all directions.
        shift: x and y are drawn uniformly from +-shift (m).
    """

    def __init__(self, rotation: float = math.pi, shift: float = 0.03) -> None:
        if rotation < 0 or shift < 0:
            raise ConfigError(
                f"augmentation has rotation = {rotation} and shift = {shift}; expected both >= 0 "
                "(radians, metres)"
            )
        self.rotation = rotation
        self.shift = shift

    def draw(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """Angle (radians) and shift in x and y (m) of one scene."""
        angle = rng.uniform(-self.rotation, self.rotation)
        x, y = rng.uniform(-self.shift, self.shift, size=2)
        return float(angle), float(x), float(y)

    def apply(
        self, parameters: SceneParameters, motions: list[tuple[float, float, float]]
    ) -> SceneParameters:
        """Every scene moved by its own motion, about the z axis first."""
        device = parameters.positions.device
        angle, x, y = np.array(motions, dtype=np.float64).T
        zero, one = np.zeros_like(angle), np.ones_like(angle)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)
        rotation = torch.as_tensor(turn, dtype=torch.float32, device=device)[:, None]
        shift = np.stack([x, y, zero], axis=-1)
        offset = torch.as_tensor(shift, dtype=torch.float32, device=device)[:, None]
        positions = (rotation @ parameters.positions[..., None])[..., 0] + offset
        present = parameters.present[..., None]
        return replace(
            parameters,
            rotations=rotation @ parameters.rotations,
            positions=torch.where(present, positions, parameters.positions),
        )
