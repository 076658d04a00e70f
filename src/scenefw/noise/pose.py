"""Noise of camera tracking: a small error in the pose of every frame."""

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from scipy.special import ndtri
from torch import Tensor

from scenefw.core.batches import CameraBatch
from scenefw.core.settings import NOT_NEGATIVE, POSITIVE, SHARE, between
from scenefw.core.types import Camera, Float64


class Jitter:
    """Moves and turns each camera by independent Gaussian amounts (thesis 4.8.6).

    The depth image stays as it is: what is wrong is where fusion believes it was taken.

    Args:
        sigma: standard deviation of the camera's position along each axis (m).
        rotation: standard deviation of its rotation about each axis (rad); None = sigma / reach.
        reach: distance at which a rotation moves points about as far as the translation does (m).
        lowest: if given, each camera has its own sigma, drawn evenly from this to sigma, and as
            much less rotation, so that a network trains on all of them.
        share: share of the cameras that are moved; the others stay where they are.

    Raises:
        ConfigError: an amount below 0, lowest above sigma, or a share that is none.
    """

    DRAWS = 8
    """Numbers in [0, 1) that one camera takes."""

    def __init__(
        self,
        sigma: float = 0.001,
        rotation: float | None = None,
        reach: float = 0.3,
        lowest: float | None = None,
        share: float = 1.0,
    ) -> None:
        NOT_NEGATIVE.require(sigma=sigma, rotation=rotation)
        POSITIVE.require(reach=reach)
        between(0, sigma).require(lowest=lowest)
        SHARE.require(share=share)
        self.sigma = sigma
        self.rotation = sigma / reach if rotation is None else rotation
        self.lowest, self.share = sigma if lowest is None else lowest, share

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """The depth images (B, H, W) themselves: their pixels are right."""
        return depth

    def move(self, camera: Camera, generator: torch.Generator) -> Camera:
        """The camera where tracking believes it to be.

        Args:
            camera: with its true pose.
            generator: on the CPU; the same draw, whatever the amounts.
        """
        normals = torch.randn(6, generator=generator, dtype=torch.float64).numpy()[None]
        amount, luck = torch.rand(2, generator=generator, dtype=torch.float64).numpy()[:, None]
        if self.sigma == 0 and self.rotation == 0:
            return camera
        pose = np.asarray(camera.T_world_camera)
        return camera.moved(pose @ self._moves(normals, amount, luck)[0])

    def moves(self, draws: Float64) -> Float64:
        """Where cameras are believed to be, from where they are: poses (B, 4, 4) in their frames.

        Args:
            draws: (B, `DRAWS`) in [0, 1).
        """
        normals = ndtri(np.clip(draws[:, :6], 2.0**-53, None))
        return self._moves(normals, draws[:, 6], draws[:, 7])

    def _moves(self, normals: Float64, amount: Float64, luck: Float64) -> Float64:
        minimum = self.lowest / self.sigma if self.sigma else 1.0
        scale = np.where(luck < self.share, minimum + (1 - minimum) * amount, 0.0)[:, None]
        turns = Rotation.from_rotvec(scale * self.rotation * normals[:, 3:]).as_matrix()
        moves = np.tile(np.eye(4), (len(normals), 1, 1))
        moves[:, :3, :3], moves[:, :3, 3] = turns, scale * self.sigma * normals[:, :3]
        return moves
