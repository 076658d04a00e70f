"""Overlap of the inside of predicted and true objects, to watch a training by."""

from collections.abc import Mapping

import torch
from torch import Tensor

from scenefw.core.batches import ShapeInstanceSetup
from scenefw.core.types import GridSpec
from scenefw.metrics.volumes import require_volume


class OccupancyOverlap:
    """Intersection over union of voxels with negative distance, over a whole batch.

    Args:
        of_samples: of drawn codes, the mean over them; else of the zero code.
        target: name of the representation of distances.
    """

    def __init__(self, *, of_samples: bool = False, target: str = "tsdf") -> None:
        self.of_samples, self.target = of_samples, target

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError if the training has no such volume."""
        require_volume("sample_iou" if self.of_samples else "iou", self.target, setup)

    def __call__(
        self, predicted: Mapping[str, Tensor], true: Mapping[str, Tensor], grid: GridSpec
    ) -> Tensor:
        """A share from 0 to 1; 1 if both are empty, as of `metrics.occupancy`."""
        mine, truth = predicted[self.target] < 0, true[self.target] < 0
        samples = mine if self.of_samples else mine[None]
        return torch.stack([_iou(sample, truth) for sample in samples]).mean()


def _iou(predicted: Tensor, truth: Tensor) -> Tensor:
    union = (predicted | truth).sum()
    return torch.where(union > 0, (predicted & truth).sum() / union.clamp(min=1), 1.0)
