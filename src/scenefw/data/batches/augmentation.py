"""Random rigid motion of whole scenes on the floor."""

import math
from dataclasses import replace

import torch
from torch import Tensor

from scenefw.core.batches import SceneParameters
from scenefw.core.rng import Streams
from scenefw.core.settings import NOT_NEGATIVE
from scenefw.core.types import Float64


class RigidAugmentation:
    """Turns a scene about the z axis and shifts it on the floor (thesis 5.2.1).

    Args:
        rotation: angles are drawn uniformly from +-rotation (radians); pi gives all directions.
        shift: x and y are drawn uniformly from +-shift (m).
    """

    def __init__(self, rotation: float = math.pi, shift: float = 0.03) -> None:
        NOT_NEGATIVE.require(rotation=rotation, shift=shift)
        self.rotation = rotation
        self.shift = shift

    def draw(self, streams: Streams) -> Float64:
        """Angle (radians) and shift in x and y (m) of one scene per stream, (B, 3)."""
        return (2 * streams.uniform(3) - 1) * (self.rotation, self.shift, self.shift)

    def apply(self, parameters: SceneParameters, motions: Tensor) -> SceneParameters:
        """Every scene moved by its own motion, about the z axis first.

        Args:
            parameters: B scenes.
            motions: (B, 3) float32 angle, x and y, on the device of the scenes.
        """
        angle, x, y = motions[:, None].unbind(-1)
        c, s = angle.cos(), angle.sin()
        px, py, pz = parameters.positions.unbind(-1)
        turned = torch.stack([c * px - s * py + x, s * px + c * py + y, pz], dim=-1)
        present = parameters.present[..., None]
        return replace(
            parameters,
            rotations=_turned(parameters.rotations, c[..., None], s[..., None]),
            positions=torch.where(present, turned, parameters.positions),
        )


def _turned(rotations: Tensor, c: Tensor, s: Tensor) -> Tensor:
    """Rotations (B, N, 3, 3) turned about z; row by row, as matrix products may be made in TF32."""
    x, y, z = rotations.unbind(-2)
    return torch.stack([c * x - s * y, s * x + c * y, z], dim=-2)
