"""Loss of flow matching between noise and sets of objects."""

import torch
from torch import Tensor

from scenefw.core.set_flows import SetFlowBatch, SetFlowPrediction, SetFlowSetup


class FlowVelocity:
    """Mean squared error of the velocity, over numbers of objects (Lipman et al. 2023).

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False

    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def check(self, setup: SetFlowSetup) -> None:
        """Any flow of sets has velocities."""

    def __call__(self, prediction: SetFlowPrediction, batch: SetFlowBatch) -> Tensor:
        """A scalar."""
        present = prediction.present[..., None]
        # Before it is squared: what absent objects should be need not be finite
        errors = torch.where(present, prediction.velocity - prediction.target, 0.0)
        return errors.square().mean(dim=-1).sum() / present.sum().clamp_min(1)
