"""Loss of the number of objects that a view doesn't show."""

from torch import Tensor
from torch.nn import functional

from scenefw.core.errors import ConfigError
from scenefw.core.set_flows import SetFlowBatch, SetFlowPrediction, SetFlowSetup


class HiddenCount:
    """Cross entropy (nats) of the number of objects of which nothing is seen.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False

    def __init__(self, weight: float = 0.3) -> None:
        self.weight = weight

    def check(self, setup: SetFlowSetup) -> None:
        """Raises a ConfigError if the network draws no such objects."""
        if not setup.draws_hidden:
            raise ConfigError(
                "loss=hidden_count needs a network that draws hidden objects; give "
                "loss=[flow_velocity] or model=set_flow"
            )

    def __call__(self, prediction: SetFlowPrediction, batch: SetFlowBatch) -> Tensor:
        """A scalar, the mean over views."""
        if prediction.counts is None or prediction.hidden is None:
            raise ValueError("the prediction has no number of hidden objects")
        return functional.cross_entropy(prediction.counts.float(), prediction.hidden)
