"""Occupancy of scenes."""

from torch import Tensor

from scenefw.core.protocols import SceneBatch
from scenefw.core.types import GridSpec


class Occupancy:
    """Whether voxel centres lie inside objects (signed distance below 0); networks give its logits.

    Trained on with the loss `bce`.
    """

    channels = 1

    def of_scenes(self, scenes: SceneBatch) -> Tensor:
        """(B, 1, X, Y, Z) bool."""
        return scenes.volumes.tsdf < 0

    def to_network(self, volume: Tensor, grid: GridSpec) -> Tensor:
        """Probabilities 0 and 1."""
        return volume.float()

    def from_network(self, output: Tensor, grid: GridSpec) -> Tensor:
        """Probabilities of logits."""
        return output.float().sigmoid()
