"""Loss of the parameters of superquadrics, in the nearest of their equal descriptions."""

from collections.abc import Sequence

import torch
from torch import Tensor

from scenefw.core.queried_sets import (
    ObjectQueryBatch,
    ObjectQueryPrediction,
    ObjectQuerySetup,
    QueriedSet,
)
from scenefw.kernels.precision import full_precision
from scenefw.losses.query_targets import taught_pairs
from scenefw.shapes.equal_descriptions import equal_descriptions

_CENTRE, _AXES, _EXPONENTS = 0.05, 0.7, 1.1  # m, and logarithms: differences that count as one


class QueryParameters:
    """Mean difference of centres, rotations, logarithms of half-axes and of exponents.

    A superquadric has 24 equal descriptions, and the least difference counts. It leads predictions
    near to their objects early in training. Later `query_distance` alone is better, as it doesn't
    mind what the shape leaves open, such as the rotation of a ball.

    Args:
        weight: factor of this term in the total.
        early: leave it out once the first part of a training is over (`learning.early`).
    """

    needs_draws = False

    def __init__(self, weight: float = 0.3, *, early: bool = True) -> None:
        self.weight, self.early = weight, early

    def check(self, setup: ObjectQuerySetup) -> None:
        """Any decoder of sets gives superquadrics."""

    def __call__(self, prediction: ObjectQueryPrediction, batch: ObjectQueryBatch) -> Tensor:
        """A scalar, the mean over pairs that are taught; 0 without any.

        It is the mean over all sets of `prediction.taught`.

        Raises:
            InputError: predictions are not matched.
        """
        return torch.stack([_of(queried_set, batch) for queried_set in prediction.taught]).mean()


def _of(queried_set: QueriedSet, batch: ObjectQueryBatch) -> Tensor:
    views, queries, objects = taught_pairs(queried_set)
    if not len(views):
        return queried_set.positions.sum() * 0
    mine = (
        queried_set.positions,
        queried_set.rotations,
        queried_set.half_axes,
        queried_set.exponents,
    )
    scenes = batch.scenes
    true = (scenes.positions, scenes.rotations, scenes.half_axes, scenes.exponents)
    return least_difference(
        [values[views, queries].float() for values in mine],
        [values[views, objects] for values in true],
    ).mean()


@full_precision()
def least_difference(mine: Sequence[Tensor], true: Sequence[Tensor]) -> Tensor:
    """Differences (K,) of superquadrics, the least over 24 descriptions of the true ones.

    Args:
        mine: positions (K, 3) m, rotations (K, 3, 3) object to world, half-axes (K, 3) m, and
            exponents (K, 3).
        true: the same of those that they are compared with.
    """
    ways = equal_descriptions().to(true[1])
    order = ways.abs().transpose(-1, -2)
    turned = true[1][:, None] @ ways

    def log_differences(values: Tensor, true_values: Tensor, unit: float) -> Tensor:
        along = (order @ true_values.log()[:, None, :, None])[..., 0]
        return (values.log()[:, None] - along) / unit

    gaps = torch.cat(
        [
            (mine[1][:, None] - turned).flatten(2),
            log_differences(mine[2], true[2], _AXES),
            log_differences(mine[3], true[3], _EXPONENTS),
        ],
        dim=-1,
    )
    centres = (mine[0] - true[0]).abs().sum(dim=-1) / _CENTRE
    return (gaps.abs().sum(dim=-1).amin(dim=-1) + centres) / (gaps.shape[-1] + 3)
