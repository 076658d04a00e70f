"""Loss of signed distances to the superquadrics of a decoder of sets."""

import torch
from torch import Tensor

from scenefw.core.errors import ConfigError
from scenefw.core.queried_sets import (
    ObjectQueryBatch,
    ObjectQueryPrediction,
    ObjectQuerySetup,
    QueriedSet,
)
from scenefw.kernels.precision import full_precision
from scenefw.losses.query_targets import taught_pairs
from scenefw.shapes.radial_distance import in_frame, radial_distance


class QueryDistance:
    """Mean difference of signed distances to matched objects, at places about these.

    Distances are those along rays from an object's centre (`radial_distance`), of prediction and
    truth alike. All descriptions of a solid have the same.

    Args:
        weight: factor of this term in the total.
        unit: a difference that counts as one (m).

    Raises:
        ConfigError: a unit that isn't positive.
    """

    needs_draws = False
    early = False

    def __init__(self, weight: float = 1.0, unit: float = 0.02) -> None:
        if not unit > 0:
            raise ConfigError(f"loss.query_distance.unit is {unit}; expected a length above 0 (m)")
        self.weight, self.unit = weight, unit

    def check(self, setup: ObjectQuerySetup) -> None:
        """Any decoder of sets gives superquadrics."""

    def __call__(self, prediction: ObjectQueryPrediction, batch: ObjectQueryBatch) -> Tensor:
        """A scalar, the mean over pairs that are taught; 0 without any.

        It is the mean over all sets of `prediction.taught`.

        Raises:
            InputError: predictions are not matched.
        """
        terms = [self._of(queried_set, batch) for queried_set in prediction.taught]
        return torch.stack(terms).mean() / self.unit

    def _of(self, queried_set: QueriedSet, batch: ObjectQueryBatch) -> Tensor:
        views, queries, objects = taught_pairs(queried_set)
        if not len(views):
            return queried_set.positions.sum() * 0
        distances = distances_of(queried_set, views, queries, batch.places[views, objects])
        return (distances - batch.distances[views, objects]).abs().mean()


@full_precision()
def distances_of(queried_set: QueriedSet, views: Tensor, queries: Tensor, places: Tensor) -> Tensor:
    """Signed distances (K, Q) of places (K, Q, 3) to the superquadrics of K queries (m)."""
    rotations, positions, axes, exponents = (
        values[views, queries].float()
        for values in (
            queried_set.rotations,
            queried_set.positions,
            queried_set.half_axes,
            queried_set.exponents,
        )
    )
    local = in_frame(places, rotations, positions)
    axes, exponents = (values[:, None].expand_as(local) for values in (axes, exponents))
    return radial_distance(local, axes, exponents)
