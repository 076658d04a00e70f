"""Loss of the predicted centres of objects."""

from torch import Tensor

from scenefw.core.errors import InputError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup
from scenefw.losses.set_targets import matched_of, require_given


class SetCentres:
    """Mean distance of predicted centres from those of the matched objects.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False

    def __init__(self, weight: float = 1e-2) -> None:
        self.weight = weight

    def check(self, setup: ObjectSetSetup) -> None:
        """Raises a ConfigError if the network predicts no centres."""
        require_given("set_centres", "centres", setup)

    def __call__(self, prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> Tensor:
        """A scalar in half sides of the grid, the mean over matched predictions; 0 without any.

        Raises:
            InputError: predictions are not matched, or have no centres.
        """
        if prediction.centres is None:
            raise InputError("the network gives no centres; choose model.centres=true")
        matched = matched_of(prediction)
        objects = matched.clamp(min=0)[..., None].expand(-1, -1, 3)
        errors = (prediction.centres.float() - batch.centres.gather(1, objects)).norm(dim=-1)
        weights = (matched >= 0).to(errors.dtype)
        return (errors * weights).sum() / weights.sum().clamp(min=1)
