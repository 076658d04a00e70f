"""Centre votes of scenes (thesis 5.2.2)."""

from torch import Tensor

from scenefw.core.protocols import SceneBatch
from scenefw.core.types import GridSpec


class VoteField:
    """Unit vectors from occupied voxel centres to the centre of mass of their object."""

    channels = 3

    def of_scenes(self, scenes: SceneBatch) -> Tensor:
        """(B, 3, X, Y, Z) float32, 0 where no object."""
        return scenes.volumes.votes

    def to_network(self, volume: Tensor, grid: GridSpec) -> Tensor:
        """Unchanged."""
        return volume

    def from_network(self, output: Tensor, grid: GridSpec) -> Tensor:
        """Unchanged, not normalised."""
        return output.float()
