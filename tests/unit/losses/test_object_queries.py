"""Losses of decoders of sets: nothing at the truth, however it is described."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from tests.unit.matching.test_queried_sets import exact
from tests.unit.models.queries import batch_of

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.queried_sets import ObjectQueryPrediction
from scenefw.losses.query_distance import QueryDistance
from scenefw.losses.query_existence import QueryExistence
from scenefw.losses.query_parameters import QueryParameters, least_difference
from scenefw.matching.queried_sets import matched_queries
from scenefw.shapes.equal_descriptions import equal_descriptions

GEOMETRIC = (QueryDistance(), QueryParameters())


def prediction(batch, found):
    return ObjectQueryPrediction([replace(found, matched=matched_queries(found, batch))])


@pytest.mark.parametrize("number", [0, 5, 13, 23])
def test_any_description_of_the_truth_costs_nothing(number):
    batch, way = batch_of(), equal_descriptions()[number]
    found = exact(batch, torch.arange(3))
    order = way.abs()
    told = replace(
        found,
        rotations=found.rotations @ way,
        half_axes=found.half_axes @ order,
        exponents=found.exponents @ order,
    )
    for loss in GEOMETRIC:
        assert float(loss(prediction(batch, told), batch)) < 1e-3


def test_parameters_differ_by_the_least_of_all_descriptions():
    """By hand: the 24 rotations of a cube put each axis anywhere, with its length and exponent."""
    random, cube = np.random.default_rng(0), Rotation.create_group("O").as_matrix()

    def drawn():
        sizes = random.uniform(0.02, 0.2, 3), random.uniform(2, 9, 3)
        return random.normal(0, 0.05, 3), Rotation.random(random_state=random).as_matrix(), *sizes

    pairs = [(drawn(), drawn()) for _ in range(5)]
    for mine, true in pairs[3:]:  # hardly apart, but told otherwise
        order = np.abs(cube[random.integers(24)])
        mine[2][:], mine[3][:] = order @ true[2], order @ true[3]
    expected = []
    for mine, true in pairs:
        costs = []
        for way in cube:
            half_axes, exponents = np.abs(way).T @ true[2], np.abs(way).T @ true[3]
            turns = np.abs(mine[1] - true[1] @ way).sum()
            lengths = np.abs(np.log(mine[2] / half_axes)).sum() / 0.7
            costs.append(turns + lengths + np.abs(np.log(mine[3] / exponents)).sum() / 1.1)
        expected.append((min(costs) + np.abs(mine[0] - true[0]).sum() / 0.05) / 18)
    stacks = (
        [torch.from_numpy(np.stack(part)) for part in zip(*side, strict=True)]
        for side in zip(*pairs, strict=True)
    )
    np.testing.assert_allclose(least_difference(*stacks), expected, rtol=1e-6)


def test_what_is_wrong_costs_more_the_more_it_is():
    batch = batch_of()
    found = exact(batch, torch.arange(3))
    changes = (
        lambda far: replace(found, positions=found.positions + 0.02 * far),
        lambda far: replace(found, half_axes=found.half_axes * (1 + 0.2 * far)),
    )
    for loss in GEOMETRIC:
        for change in changes:
            costs = [float(loss(prediction(batch, change(far)), batch)) for far in (0, 1, 2)]
            assert costs[0] < costs[1] < costs[2]


def test_queries_that_stand_for_nothing_learn_what_they_start_on():
    batch = batch_of()
    found = exact(batch, torch.tensor([0, 1, 1]))
    wrong = replace(found, positions=found.positions + torch.tensor([[[0.0]], [[0.05]]]))
    matched = torch.tensor([[0, 1, -1], [-1, -1, -1]])
    owned = torch.tensor([[1, 0, 1], [-1, -1, 1]])
    for loss in GEOMETRIC:
        alone, dense, resting = (
            float(loss(ObjectQueryPrediction([replace(wrong, **changed)]), batch))
            for changed in (
                {"matched": matched},
                {"matched": matched, "owned": owned},
                {"matched": matched, "owned": owned, "active": wrong.active & False},
            )
        )
        assert alone == resting < 1e-3
        assert dense > 0.03


def test_existence_is_of_queries_that_count():
    batch = batch_of()
    found = exact(batch, torch.arange(3), logits=8.0)
    all_there = float(QueryExistence()(prediction(batch, found), batch))
    assert 1 < all_there < 2  # one of six is said to exist, and doesn't
    found.existence[0, 2] = -8.0
    assert float(QueryExistence()(prediction(batch, found), batch)) < 1e-3
    found.existence[0, 2] = 8.0
    active = torch.tensor([[True, True, False], [True] * 3])
    resting = prediction(batch, replace(found, active=active))
    assert float(QueryExistence()(resting, batch)) < 1e-3


def test_scenes_without_objects_teach_existence_alone():
    batch = batch_of()
    nothing = replace(batch.scenes, present=torch.zeros_like(batch.scenes.present))
    batch = replace(batch, scenes=nothing)
    found = exact(batch, torch.arange(3), logits=-8.0)
    found = replace(found, positions=found.positions.clone().requires_grad_())
    for loss in GEOMETRIC:
        value = loss(prediction(batch, found), batch)
        value.backward()
        assert float(value) == 0
    assert float(QueryExistence()(prediction(batch, found), batch)) < 1e-3


def test_what_is_not_matched_or_means_nothing_is_refused():
    batch = batch_of()
    plain = ObjectQueryPrediction([exact(batch, torch.arange(3))])
    for loss in (*GEOMETRIC, QueryExistence()):
        with pytest.raises(InputError, match="not matched"):
            loss(plain, batch)
    with pytest.raises(ConfigError, match=r"loss\.query_distance\.unit is 0"):
        QueryDistance(unit=0.0)


def test_the_truth_costs_nothing_in_mixed_precision():
    """Axes of the truth that are rounded to 8 bits are another object."""
    batch = batch_of()
    found = prediction(batch, exact(batch, torch.arange(3)))
    with torch.autocast("cpu", torch.bfloat16):
        for loss in GEOMETRIC:
            assert float(loss(found, batch)) < 1e-3
