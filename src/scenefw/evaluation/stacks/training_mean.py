"""What is known before any image: how often each voxel is occupied in the training scenes."""

import numpy as np

from scenefw.core.types import Float64, GridSpec
from scenefw.data.batches.stacks import StackScenes
from scenefw.representations.volumes import object_occupancy

_AT_ONCE = 16  # scenes whose volumes are in memory together


class TrainingMean:
    """Occupancy of training scenes, per voxel and over all: forecasts without an image.

    Args:
        scenes: of the training split.
    """

    def __init__(self, scenes: StackScenes) -> None:
        self.scenes = scenes
        self._counts: dict[GridSpec, Float64] = {}

    def probability(self, grid: GridSpec) -> Float64:
        """Share (X, Y, Z) of scenes in which a voxel is occupied, never 0 or 1.

        It is drawn to the overall share as by one more scene, so that no voxel is certain.
        """
        counts, scenes = self._of(grid), len(self.scenes)
        return (counts + counts.mean() / scenes) / (scenes + 1)

    def rate(self, grid: GridSpec) -> float:
        """The share of all voxels that is occupied."""
        return float(self._of(grid).mean() / len(self.scenes))

    def _of(self, grid: GridSpec) -> Float64:
        if grid not in self._counts:
            self._counts[grid] = self._counted(grid)
        return self._counts[grid]

    def _counted(self, grid: GridSpec) -> Float64:
        counts = np.zeros(grid.shape)
        for start in range(0, len(self.scenes), _AT_ONCE):
            rows = list(range(start, min(start + _AT_ONCE, len(self.scenes))))
            occupied = object_occupancy(self.scenes.parameters(rows), grid).any(dim=1)
            counts += occupied.sum(dim=0).numpy()
        return counts
