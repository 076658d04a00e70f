"""Loss of networks that say where rays enter and leave an object."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from scenefw.losses.part_affinity import mean_over
from scenefw.shapes.object_shell import ENTRY, EXIT, GAP_END, GAP_START

if TYPE_CHECKING:
    from scenefw_things.shells.batches import ObjectShellBatch, ShellPrediction, ShellSetup


class ShellDepth:
    """Absolute errors of depths in widths of the crop: what two solids along a ray differ by.

    Entry and exit count where the ray meets the object, ends of the gap where it passes a hollow.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False

    def __init__(self, weight: float = 4.0) -> None:
        self.weight = weight

    def check(self, setup: ShellSetup) -> None:
        """Any crop has depths."""

    def __call__(self, prediction: ShellPrediction, batch: ObjectShellBatch) -> Tensor:
        """A scalar."""
        true, scales = batch.shells, batch.scales[:, None, None, None]
        errors = (prediction.depths - true.depths).abs() / scales
        ends = mean_over(errors[:, [ENTRY, EXIT]].sum(dim=1), true.amodal)
        gaps = errors[:, [GAP_START, GAP_END]].sum(dim=1)
        return ends + torch.where(true.hollow, gaps, 0.0).sum() / true.amodal.sum().clamp_min(1)
