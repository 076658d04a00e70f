"""Binary cross entropy of any volume of probabilities."""

from torch import Tensor
from torch.nn import functional

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.losses.targets import require_target


class BinaryCrossEntropy:
    """Mean binary cross entropy (nats) of logits and a target from 0 to 1.

    Args:
        weight: factor of this term in the total.
        target: name of the representation.
    """

    needs_draws = False

    def __init__(self, weight: float = 1.0, target: str = "occupancy") -> None:
        self.weight, self.target = weight, target

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError if the training has no such volume."""
        require_target("bce", self.target, setup)

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar, the mean over voxels and channels."""
        logits, true = prediction.volumes[self.target], batch.targets[self.target]
        return functional.binary_cross_entropy_with_logits(logits.float(), true.float())
