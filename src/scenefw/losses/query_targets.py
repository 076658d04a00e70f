"""Pairs of predicted and true superquadrics that losses of decoders of sets compare."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from scenefw.core.errors import InputError

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.queried_sets import QueriedSet


def pairs_of(found: QueriedSet) -> tuple[Tensor, Tensor, Tensor]:
    """Views, queries and objects (K,) that are matched.

    Raises:
        InputError: nothing was matched yet.
    """
    return _pairs(matched_of(found))


def taught_pairs(found: QueriedSet) -> tuple[Tensor, Tensor, Tensor]:
    """The same, and queries that stand for nothing with the object at whose surface they start.

    Raises:
        InputError: nothing was matched yet.
    """
    matched = matched_of(found)
    if found.owned is None:
        return _pairs(matched)
    return _pairs(torch.where((matched < 0) & found.active, found.owned, matched))


def _pairs(objects: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    views, queries = (objects >= 0).nonzero(as_tuple=True)
    return views, queries, objects[views, queries]


def matched_of(found: QueriedSet) -> Tensor:
    """The object (B, N) of each query, -1 = none.

    Raises:
        InputError: they were not matched.
    """
    if found.matched is None:
        raise InputError(
            "predictions are not matched to objects; train with learning=object_queries"
        )
    return found.matched
