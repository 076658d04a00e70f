"""Loss of networks that say which pixels of a depth image show objects, and which obstacles."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from scenefw.core.errors import ConfigError
from scenefw.core.part_views import PartViewBatch, PartViewSetup
from scenefw.losses.part_affinity import mean_over


class PartShownCrossEntropy:
    """Binary cross entropy of pixels that show objects; all of these count as much as all others.

    The same of obstacles, if the network says which pixels show them. Pixels without depth are left
    out.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws, teaches_shown = False, True

    def __init__(self, weight: float = 0.5) -> None:
        self.weight = weight

    def check(self, setup: PartViewSetup) -> None:
        """Raises a ConfigError if the network doesn't say which pixels show objects."""
        if not setup.shown:
            raise ConfigError(
                "loss part_shown needs a network that says which pixels show objects; give "
                "model.shown=true, or leave the loss out with '~loss.part_shown'"
            )

    def __call__(self, prediction: Tensor, batch: PartViewBatch) -> Tensor:
        """A scalar from logits (B, 3 or 4, H, W), of which the last ones count."""
        valid, is_owned = batch.depth > 0, batch.owners > 0
        none = torch.zeros_like(is_owned)
        obstacles = none if batch.obstacles is None else batch.obstacles & is_owned
        targets = (is_owned & ~obstacles, obstacles)
        return torch.stack(
            [
                _balanced(logits, target, valid)
                for logits, target in zip(prediction[:, 2:].unbind(1), targets, strict=False)
            ]
        ).sum()


def _balanced(logits: Tensor, target: Tensor, valid: Tensor) -> Tensor:
    errors = binary_cross_entropy_with_logits(logits, target.float(), reduction="none")
    return mean_over(errors, valid & target) + mean_over(errors, valid & ~target)
