"""What several drawn codes are worth together, to watch a training by."""

from collections.abc import Mapping

import torch
from torch import Tensor

from scenefw.core.batches import ShapeInstanceSetup
from scenefw.core.types import GridSpec
from scenefw.metrics.volumes import require_volume


class ExpectedOccupancy:
    """Binary cross entropy (nats) of the share of samples in which a voxel is inside.

    If the samples do not differ, it is 100 nats for each wrong voxel.

    Args:
        target: name of the representation of distances.
    """

    of_samples = True

    def __init__(self, target: str = "tsdf") -> None:
        self.target = target

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError if the training has no such volume."""
        require_volume("sample_bce", self.target, setup)

    def __call__(
        self, predicted: Mapping[str, Tensor], true: Mapping[str, Tensor], grid: GridSpec
    ) -> Tensor:
        """The mean over voxels."""
        expected = (predicted[self.target] < 0).float().mean(dim=0)
        occupied = true[self.target] < 0
        # written out: autocast on CUDA has no binary_cross_entropy of probabilities
        logs = torch.where(occupied, expected, 1 - expected).log().clamp(min=-100)
        return -logs.mean()
