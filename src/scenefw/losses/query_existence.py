"""Loss of the existence score of each query of a decoder of sets."""

import torch
from torch import Tensor
from torch.nn import functional

from scenefw.core.queried_sets import ObjectQueryBatch, ObjectQueryPrediction, ObjectQuerySetup
from scenefw.losses.query_targets import matched_of


class QueryExistence:
    """Binary cross entropy (nats) that a query stands for an object (Carion et al. 2020).

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False
    early = False

    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def check(self, setup: ObjectQuerySetup) -> None:
        """Any decoder of sets has existence scores."""

    def __call__(self, prediction: ObjectQueryPrediction, batch: ObjectQueryBatch) -> Tensor:
        """A scalar, the mean over queries that count in all sets of `prediction.taught`.

        Raises:
            InputError: predictions are not matched.
        """
        terms = []
        for queried_set in prediction.taught:
            targets = (matched_of(queried_set) >= 0).to(queried_set.existence.dtype)
            errors = functional.binary_cross_entropy_with_logits(
                queried_set.existence, targets, reduction="none"
            )
            counted = queried_set.active.to(errors.dtype)
            terms.append((errors * counted).sum() / counted.sum().clamp_min(1))
        return torch.stack(terms).mean()
