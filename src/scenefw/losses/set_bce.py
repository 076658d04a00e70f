"""Binary cross entropy of sets of objects, each prediction against its own object."""

from torch import Tensor
from torch.nn import functional

from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup
from scenefw.losses.set_targets import matched_of, object_sums


class SetBinaryCrossEntropy:
    """Mean binary cross entropy (nats) of predicted objects and those they are matched to.

    Of a logit x and a target t in {0, 1} it is softplus(x) - t x.

    Predictions without an object are compared with an empty grid. The mean is over voxels and
    predictions (thesis 6.2.1). Matching comes before the loss and no gradient passes through it.

    Args:
        weight: factor of this term in the total; the thesis's is 1, and 200 in eq. 6.2.
    """

    needs_draws = False

    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def check(self, setup: ObjectSetSetup) -> None:
        """Fits any set."""

    def __call__(self, prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> Tensor:
        """A scalar.

        Raises:
            InputError: predictions are not matched.
        """
        logits = prediction.logits.float()
        inside, _ = object_sums(logits, matched_of(prediction), batch)
        return functional.softplus(logits).mean() - inside.sum() / logits.numel()
