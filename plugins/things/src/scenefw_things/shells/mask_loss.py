"""Loss of networks that say which rays meet an object, and which pass a hollow of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from scenefw.losses.part_affinity import mean_over

if TYPE_CHECKING:
    from scenefw_things.shells.batches import ObjectShellBatch, ShellPrediction, ShellSetup


class ShellMask:
    """Cross entropy of amodal masks over all pixels, and of hollows over those of the object.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False

    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def check(self, setup: ShellSetup) -> None:
        """Any crop has masks."""

    def __call__(self, prediction: ShellPrediction, batch: ObjectShellBatch) -> Tensor:
        """A scalar."""
        true = batch.shells
        masks = binary_cross_entropy_with_logits(prediction.amodal, true.amodal.float())
        hollows = binary_cross_entropy_with_logits(
            prediction.hollow, true.hollow.float(), reduction="none"
        )
        return masks + mean_over(hollows, true.amodal)
