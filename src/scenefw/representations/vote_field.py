"""Centre votes of scenes (thesis 5.2.2)."""

from torch import Tensor

from scenefw.core.batches import SceneParameters
from scenefw.core.types import GridSpec
from scenefw.representations.volumes import scene_volumes


class VoteField:
    """Unit vectors from occupied voxel centres to the centre of mass of their object."""

    def of_scenes(self, parameters: SceneParameters, grid: GridSpec) -> Tensor:
        """(B, 3, X, Y, Z) float32, 0 where no object."""
        return scene_volumes(parameters, grid).votes
