"""Loss of the existence score of each predicted object."""

from torch import Tensor
from torch.nn import functional

from scenefw.core.errors import InputError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup
from scenefw.losses.set_targets import matched_of, require_given


class SetExistence:
    """Binary cross entropy (nats) that a prediction stands for an object (Carion et al. 2020).

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False

    def __init__(self, weight: float = 1e-3) -> None:
        self.weight = weight

    def check(self, setup: ObjectSetSetup) -> None:
        """Raises a ConfigError if the network has no such score."""
        require_given("set_existence", "existence", setup)

    def __call__(self, prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> Tensor:
        """A scalar, the mean over predictions.

        Raises:
            InputError: predictions are not matched, or have no such score.
        """
        if prediction.existence is None:
            raise InputError("the network gives no existence score; choose model.existence=true")
        scores = prediction.existence.float()
        targets = (matched_of(prediction) >= 0).to(scores.dtype)
        return functional.binary_cross_entropy_with_logits(scores, targets)
