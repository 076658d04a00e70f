"""Energy score of shells: hypotheses that are likely as whole objects."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from scenefw.core.errors import ConfigError
from scenefw.shapes.object_shell import ENTRY, EXIT

if TYPE_CHECKING:
    from scenefw_things.shells.batches import ObjectShellBatch, ShellPrediction, ShellSetup

_EPSILON = 1e-6  # widths^2 of a crop: the root's slope stays finite where two shells agree


class ShellEnergy:
    """Energy score of two hypotheses of an object (Gneiting and Raftery 2007).

    (|a - t| + |b - t| - |a - b|) / 2 for shells a, b and the truth t, |.| the root mean square over
    a crop: of entry and exit in widths of the crop where the truth meets the object, and of the
    mask everywhere. It is least if hypotheses are distributed as the truth is.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = True

    def __init__(self, weight: float = 4.0) -> None:
        self.weight = weight

    def check(self, setup: ShellSetup) -> None:
        """Checks that codes are drawn.

        Raises:
            ConfigError: they aren't.
        """
        if not setup.drawn:
            raise ConfigError(
                "the loss shell_energy needs two codes of a crop; give model.drawn of more than 0 "
                "and a batch large enough for it, or leave the loss out"
            )

    def __call__(self, prediction: ShellPrediction, batch: ObjectShellBatch) -> Tensor:
        """A scalar, 0 where nothing was drawn."""
        if prediction.draws is None:
            return prediction.depths.new_zeros(())
        first, second = prediction.draws
        count, true = len(first.depths), batch.shells
        amodal = true.amodal[:count, None].float()
        scales = batch.scales[:count, None, None, None]

        def vector(depths: Tensor, mask: Tensor) -> Tensor:
            ends = depths[:, [ENTRY, EXIT]] / scales * amodal
            return torch.cat([ends, mask[:, None]], dim=1)

        def distance(a: Tensor, b: Tensor) -> Tensor:
            return ((a - b).square().mean(dim=(1, 2, 3)) + _EPSILON).sqrt()

        a, b = (vector(draw.depths, draw.amodal.sigmoid()) for draw in (first, second))
        t = vector(true.depths[:count], true.amodal[:count].float())
        return (0.5 * (distance(a, t) + distance(b, t) - distance(a, b))).mean()
