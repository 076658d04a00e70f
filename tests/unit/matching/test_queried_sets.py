"""Queries and the objects that they stand for."""

from dataclasses import replace

import torch
from tests.unit.models.queries import batch_of

from scenefw.core.queried_sets import QueriedSet
from scenefw.matching.queried_sets import matched_queries, owners_of, pair_costs


def exact(batch, order, logits=0.0):
    """A set that is the truth, in another order."""
    s = batch.scenes
    fields = (s.half_axes, s.exponents, s.rotations, s.positions)
    shape = s.present.shape
    active = torch.ones(shape, dtype=torch.bool)
    return QueriedSet(
        torch.full(shape, logits), *(one[:, order] for one in fields), active, s.positions
    )


def test_the_truth_in_another_order_is_found_again():
    batch = batch_of(objects=4)
    order = torch.tensor([2, 0, 3, 1])
    found = matched_queries(exact(batch, order), batch)
    wanted = torch.where(batch.scenes.present[:, order], order, -1)
    assert torch.equal(found, wanted)
    costs = pair_costs(exact(batch, order), batch)
    assert torch.allclose(costs[1, torch.arange(4), order], torch.tensor(-0.5), atol=1e-3)


def test_queries_that_do_not_count_stand_for_nothing():
    batch = batch_of()
    found = exact(batch, torch.arange(3))
    resting = replace(found, active=torch.tensor([[True, False, False], [False, False, False]]))
    assert matched_queries(resting, batch).tolist() == [[0, -1, -1], [-1, -1, -1]]


def test_of_equal_queries_the_surer_one_is_taken():
    batch = batch_of()
    alone = batch.scenes.present & (torch.arange(3) == 1)
    batch = replace(batch, scenes=replace(batch.scenes, present=alone))
    found = exact(batch, torch.tensor([1, 1, 1]), logits=-2.0)
    found.existence[:, 2] = 3.0
    assert matched_queries(found, batch).tolist() == [[-1, -1, 1]] * 2


def test_queries_start_at_the_object_nearest_to_their_seed():
    batch = batch_of(places=64)
    seeds = batch.points.unflatten(1, (3, 64))[:, :, 0]
    found = replace(exact(batch, torch.arange(3)), starts=seeds)
    wanted = torch.where(batch.scenes.present, torch.arange(3), -1)
    assert torch.equal(owners_of(found, batch), wanted)
    assert (owners_of(replace(found, starts=seeds + 3.0), batch) == -1).all()


def test_without_objects_nothing_is_matched():
    batch = batch_of()
    nothing = replace(batch.scenes, present=torch.zeros_like(batch.scenes.present))
    found = matched_queries(exact(batch, torch.arange(3)), replace(batch, scenes=nothing))
    assert (found == -1).all()


def test_costs_are_the_same_in_mixed_precision():
    batch = batch_of()
    found = exact(batch, torch.arange(3))
    with torch.autocast("cpu", torch.bfloat16):
        mixed = pair_costs(found, batch), owners_of(found, batch)
    assert torch.equal(mixed[0], pair_costs(found, batch))
    assert torch.equal(mixed[1], owners_of(found, batch))
