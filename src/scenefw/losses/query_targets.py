"""Pairs of predicted and true superquadrics that losses of decoders of sets compare."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from scenefw.core.errors import InputError

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.queried_sets import QueriedSet


def pairs_of(queried_set: QueriedSet) -> tuple[Tensor, Tensor, Tensor]:
    """Views, queries and objects (K,) that are matched.

    Raises:
        InputError: nothing was matched yet.
    """
    return _pairs(matched_of(queried_set))


def taught_pairs(queried_set: QueriedSet) -> tuple[Tensor, Tensor, Tensor]:
    """The same, and queries that stand for nothing with the object at whose surface they start.

    Raises:
        InputError: nothing was matched yet.
    """
    matched = matched_of(queried_set)
    if queried_set.owned is None:
        return _pairs(matched)
    return _pairs(torch.where((matched < 0) & queried_set.active, queried_set.owned, matched))


def _pairs(objects: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    views, queries = (objects >= 0).nonzero(as_tuple=True)
    return views, queries, objects[views, queries]


def matched_of(queried_set: QueriedSet) -> Tensor:
    """The object (B, N) of each query, -1 = none.

    Raises:
        InputError: they were not matched.
    """
    if queried_set.matched is None:
        raise InputError(
            "predictions are not matched to objects; train with learning=object_queries"
        )
    return queried_set.matched
