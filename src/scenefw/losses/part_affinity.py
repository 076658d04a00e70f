"""Loss of networks that say which neighbouring pixels show the same object."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from scenefw.core.part_views import PartViewBatch, PartViewSetup


class PartAffinityCrossEntropy:
    """Binary cross entropy of affinities; borders count as much as all that is not one.

    Borders are about a fiftieth of the pairs of pixels. Pairs of which neither shows an object
    are left out: nothing cuts the floor.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws, teaches_shown = False, False

    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def check(self, setup: PartViewSetup) -> None:
        """Any image has neighbours."""

    def __call__(self, prediction: Tensor, batch: PartViewBatch) -> Tensor:
        """A scalar from logits (B, 2 to 4, H, W)."""
        same_object, counts = true_affinities(batch.owners)
        errors = binary_cross_entropy_with_logits(
            prediction[:, :2], same_object.float(), reduction="none"
        )
        return mean_over(errors, counts & same_object) + mean_over(errors, counts & ~same_object)


def true_affinities(owners: Tensor) -> tuple[Tensor, Tensor]:
    """Whether the right and the lower neighbour show the same, and which pairs count.

    Args:
        owners: (B, H, W) of pixels, 0 = none.

    Returns:
        Two bool tensors (B, 2, H, W); of the last column and row nothing counts.
    """
    right, below = owners.roll(-1, 2), owners.roll(-1, 1)
    same_object = torch.stack([owners == right, owners == below], dim=1)
    counts = torch.stack([(owners > 0) | (right > 0), (owners > 0) | (below > 0)], dim=1)
    counts[:, 0, :, -1] = False
    counts[:, 1, -1] = False
    return same_object, counts


def mean_over(errors: Tensor, of: Tensor) -> Tensor:
    """Mean of errors where `of` is true, 0 where it is nowhere."""
    return torch.where(of, errors, 0.0).sum() / of.sum().clamp_min(1)
