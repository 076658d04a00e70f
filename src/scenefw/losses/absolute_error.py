"""Absolute error of any volume."""

from torch import Tensor

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.losses.targets import require_target


class AbsoluteError:
    """Mean absolute difference of an output and its target, in the units of the network.

    Args:
        weight: factor of this term in the total.
        target: name of the representation.
    """

    needs_draws = False

    def __init__(self, weight: float = 1.0, target: str = "tsdf") -> None:
        self.weight, self.target = weight, target

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError if the training has no such volume."""
        require_target("l1", self.target, setup)

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar, the mean over voxels and channels."""
        predicted, true = prediction.volumes[self.target], batch.targets[self.target]
        return (predicted.float() - true.float()).abs().mean()
