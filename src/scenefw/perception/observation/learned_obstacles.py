"""Obstacles that a network tells from objects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.core.settings import COUNT
from scenefw.perception.observation.components import EDGE, depth_parts
from scenefw.perception.observation.obstacles import ObstacleRegion
from scenefw.perception.observation.pixel_probabilities import pixel_probabilities
from scenefw.perception.observation.pixels import WIDTH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.part_protocols import PartAffinityModel
    from scenefw.core.training_protocols import Trained
    from scenefw.core.types import Float64, Frame

    Mask = NDArray[np.bool_]


class LearnedObstacles:
    """Takes for obstacles what a network takes for one rather than for an object.

    Args:
        checkpoint: a trained network of affinities that says which pixels show obstacles.
        min_pixels: connected surfaces of fewer (of an image 640 wide) are none.

    Raises:
        ConfigError: the network doesn't say it, or fewer than one pixel.
    """

    def __init__(self, checkpoint: Trained[PartAffinityModel], min_pixels: float) -> None:
        COUNT.require(min_pixels=min_pixels)
        self.model: PartAffinityModel = checkpoint.model
        self.min_pixels = min_pixels
        if self.model.obstacles is None or self.model.shown is None:
            raise ConfigError(
                "these weights say nothing of obstacles: give checkpoints.part_affinity=FILE as "
                "experiment=part_images makes it, or obstacles=geometric"
            )

    def find(
        self, frame: Frame, points: Float64, raised: Mask, floor: Mask
    ) -> list[ObstacleRegion]:
        """Obstacles, which share no pixel.

        Args:
            frame: whose floor is z = 0.
            points: (H, W, 3) of the pixels (m), NaN = no depth.
            raised: (H, W) pixels of what rises above the floor.
            floor: (H, W) pixels of the floor.
        """
        probabilities = pixel_probabilities(self.model, frame)
        assert probabilities.obstacles is not None
        assert probabilities.objects is not None
        likely = probabilities.obstacles > probabilities.objects
        rows, columns = (np.arange(size) // probabilities.step for size in frame.depth.shape)
        surfaces = depth_parts(frame.depth, raised & likely[np.ix_(rows, columns)], EDGE)
        min_pixels = self.min_pixels * (frame.depth.shape[1] / WIDTH) ** 2
        is_large = np.bincount(surfaces.ravel()) >= min_pixels
        pixels = is_large[surfaces] & (surfaces > 0)
        return [ObstacleRegion("obstacle", pixels)] if pixels.any() else []
