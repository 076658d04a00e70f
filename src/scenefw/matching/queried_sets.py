"""Which true object each predicted superquadric stands for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from scenefw.kernels.precision import full_precision
from scenefw.matching.assignment import Assignment
from scenefw.shapes.radial_distance import in_frame, radial_distance

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.protocols import Matching
    from scenefw.core.queried_sets import ObjectQueryBatch, QueriedSet

_PLACES = 32  # about each object, at which distances are compared
_NEAR, _CLOSE = 0.05, 0.02  # m: centres and distances that differ by this cost one
_AT = 0.01  # m: a query starts at a surface that is this near
_NEVER = 1e6


@torch.no_grad()
def matched_queries(
    predicted: QueriedSet, batch: ObjectQueryBatch, matching: Matching | None = None
) -> Tensor:
    """The object (B, N) that each query stands for, -1 = none.

    The assignment has the least sum of costs of pairs (Carion et al. 2020).

    Args:
        predicted: of one layer.
        batch: with the true objects.
        matching: default is the optimal assignment.
    """
    costs = pair_costs(predicted, batch).cpu()
    costs = costs.nan_to_num(_NEVER, _NEVER, -_NEVER)  # a training that diverged says so itself
    matched = torch.full(predicted.existence.shape, -1)
    matching = matching or Assignment()
    usable, present = predicted.active.cpu(), batch.scenes.present.cpu()
    for view in range(len(matched)):
        queries, objects = usable[view].nonzero()[:, 0], present[view].nonzero()[:, 0]
        if not len(queries) or not len(objects):
            continue
        pairs = torch.from_numpy(matching.assign(costs[view][queries][:, objects].double().numpy()))
        matched[view, queries[pairs[:, 0]]] = objects[pairs[:, 1]]
    return matched.to(predicted.existence.device)


@torch.no_grad()
@full_precision()
def owners_of(predicted: QueriedSet, batch: ObjectQueryBatch) -> Tensor:
    """The object (B, N) at whose surface each query starts, -1 = none."""
    scenes = batch.scenes
    local = in_frame(predicted.starts[:, None], scenes.rotations, scenes.positions)
    axes, exponents = (
        values[:, :, None].expand_as(local) for values in (scenes.half_axes, scenes.exponents)
    )
    gaps = radial_distance(local, axes, exponents).abs()
    gap, owner = torch.where(scenes.present[:, :, None], gaps, torch.inf).min(dim=1)
    return torch.where(gap < _AT, owner, -1)


@full_precision()
def pair_costs(predicted: QueriedSet, batch: ObjectQueryBatch) -> Tensor:
    """Costs (B, N, M) that queries stand for objects: chance of existence, centres, distances."""
    scenes = batch.scenes
    gaps = torch.linalg.vector_norm(
        predicted.positions[:, :, None] - scenes.positions[:, None], dim=-1
    )
    step = max(batch.places.shape[2] // _PLACES, 1)
    places, true = batch.places[:, :, ::step], batch.distances[:, :, ::step]
    local = in_frame(places.flatten(1, 2)[:, None], predicted.rotations, predicted.positions)
    axes, exponents = (
        values[:, :, None].expand_as(local) for values in (predicted.half_axes, predicted.exponents)
    )
    mine = radial_distance(local, axes, exponents).unflatten(-1, true.shape[1:])
    distance_errors = (mine - true[:, None]).abs().mean(dim=-1)
    exists = predicted.existence.float().sigmoid()[..., None]
    return gaps / _NEAR + distance_errors / _CLOSE - exists
