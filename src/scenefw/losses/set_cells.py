"""Supervision of the cells that codes are taken from."""

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor
from torch.nn import functional

from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup


class SetCells:
    """Asks for the largest channel means where objects are (an answer to thesis fig. 6.9).

    Every object gets a cell of its own, all together as near to their centres as can be, as several
    centres may lie in one. The loss is the binary cross entropy of the channel means, as logits,
    against these cells; cells of objects have half of the weight together.

    Args:
        weight: factor of this term in the total.
        sharpness: logits per channel mean.
    """

    needs_draws = False

    def __init__(self, weight: float = 1e-2, sharpness: float = 4.0) -> None:
        self.weight, self.sharpness = weight, sharpness

    def check(self, setup: ObjectSetSetup) -> None:
        """Fits any set."""

    def __call__(self, prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> Tensor:
        """A scalar in nats, the mean of that over objects' cells and that over all others."""
        means = prediction.features.float().flatten(2).mean(dim=1)
        targets = cells_of_objects(batch.centres, batch.present, prediction.features.shape[-1])
        errors = functional.softplus(self.sharpness * means.where(~targets, -means))
        return 0.5 * (_mean(errors, targets) + _mean(errors, ~targets))


@torch.no_grad()
def cells_of_objects(centres: Tensor, present: Tensor, side: int) -> Tensor:
    """Which cells (B, S^3) bool hold an object: one each, at least total squared distance.

    Args:
        centres: (B, M, 3) in the cube of the grid, each axis from -1 to 1.
        present: (B, M) bool.
        side: cells per side of the cube, S; more than S^3 objects don't all get one.
    """
    axis = (np.arange(side) + 0.5) * (2 / side) - 1
    places = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = torch.zeros(len(centres), side**3, dtype=torch.bool)
    for row, points, present_mask in zip(cells, centres.cpu(), present.cpu(), strict=True):
        offsets = points[present_mask].double().numpy()[:, None] - places
        row[linear_sum_assignment((offsets**2).sum(axis=-1))[1]] = True
    return cells.to(centres.device)


def _mean(errors: Tensor, mask: Tensor) -> Tensor:
    return (errors * mask).sum() / mask.sum().clamp(min=1)
