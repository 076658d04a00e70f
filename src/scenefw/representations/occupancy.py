"""Occupancy of scenes."""

from torch import Tensor

from scenefw.core.batches import SceneParameters
from scenefw.core.types import GridSpec
from scenefw.representations.volumes import object_occupancy


class Occupancy:
    """Whether voxel centres lie inside objects (occupied = signed distance below 0).

    Args:
        per_object: one channel for each of the N objects, else one for all.
    """

    def __init__(self, *, per_object: bool = False) -> None:
        self.per_object = per_object

    def of_scenes(self, parameters: SceneParameters, grid: GridSpec) -> Tensor:
        """(B, 1, X, Y, Z) or (B, N, X, Y, Z) bool, False where an object is absent."""
        occupancy = object_occupancy(parameters, grid)
        return occupancy if self.per_object else occupancy.any(dim=1, keepdim=True)
