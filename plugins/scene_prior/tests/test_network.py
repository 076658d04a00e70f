"""Sets of superquadrics as numbers, and the network that draws them."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.models.test_set_extents import SMALL as OF_EXTENTS
from tests.unit.models.test_set_extents import boxes
from tests.unit.models.viewed_sets import batch_of

from scenefw.core.errors import ConfigError
from scenefw.core.set_flows import SetFlowBatch, SetFlowSetup
from scenefw.losses.flow_velocity import FlowVelocity
from scenefw.models.set_extents import SetExtents
from scenefw.shapes.equal_descriptions import equal_descriptions
from scenefw.shapes.superquadric import Superquadric
from scenefw_scene_prior.hidden_count import HiddenCount
from scenefw_scene_prior.network import SetFlow, coupled
from scenefw_scene_prior.superquadric_tokens import (
    SIZE,
    decode,
    described_in_all_ways,
    encode,
)

SMALL = {"slots": 4, "width": 32, "layers": 2, "view_layers": 1, "heads": 2}


def test_numbers_say_the_object_and_so_do_all_24_descriptions():
    batch = batch_of()
    anchors = batch.points.mean(dim=2)
    objects = encode(batch.positions, batch.rotations, batch.half_axes, batch.exponents, anchors)
    for found, true in zip(
        decode(objects, anchors),
        (batch.positions, batch.rotations, batch.half_axes, batch.exponents),
        strict=True,
    ):
        assert torch.allclose(found, true, rtol=1e-4, atol=1e-5)
    assert len(torch.unique(equal_descriptions(), dim=0)) == 24
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (50, 3))
    own = Superquadric(batch.half_axes[0, 0].numpy(), batch.exponents[0, 0].numpy())
    wanted = own.value(points @ batch.rotations[0, 0].double().numpy())
    every = described_in_all_ways(objects)[0, 0]
    assert len(torch.unique(every.round(decimals=4), dim=0)) == 24
    for one in every:
        _, turn, axes, exponents = decode(one, anchors[0, 0])
        value = Superquadric(axes.numpy(), exponents.numpy()).value(points @ turn.double().numpy())
        assert np.allclose(value, wanted, rtol=1e-2)


def test_coupling_takes_the_nearest_descriptions_and_the_best_order_of_hidden_objects():
    random = torch.Generator().manual_seed(3)
    objects = encode(*_objects(1, 4), torch.zeros(1, 4, 3))
    noise = torch.randn(1, 4, SIZE, generator=random)
    present, seen = torch.ones(1, 4, dtype=torch.bool), torch.tensor([[True, False, False, False]])
    found = coupled(objects, noise, present, seen)
    ways = described_in_all_ways(objects)[0]
    gaps = (noise[0][:, None, None] - ways[None]).square().sum(-1).amin(-1)  # slot, object
    best = min(
        gaps[0, 0] + sum(gaps[1 + i, 1 + j] for i, j in enumerate(order))
        for order in itertools.permutations(range(3))
    )
    assert torch.isclose((found - noise).square().sum(), best, rtol=1e-4)


def _objects(views, objects):
    batch = batch_of(views, objects)
    return batch.positions, batch.rotations, batch.half_axes, batch.exponents


def test_no_order_among_objects():
    torch.manual_seed(0)
    model, batch = SetFlow(**SMALL).eval(), batch_of()
    order = torch.tensor([2, 0, 1])
    moved = SetFlowBatch(
        *[x if x.ndim == 2 and x.shape[1] == 3 and x is batch.camera else x[:, order]
          for x in vars(batch).values()]
    )  # fmt: skip
    now, time = torch.randn(2, 3, SIZE), torch.tensor([0.2, 0.7])
    given = torch.ones(2, dtype=torch.bool)

    def velocity(one, state):
        memory, counts = model.encode(one, given)
        return model.velocity_of(state, time, memory, one.seen, one.present), counts

    (first, counts), (second, again) = velocity(batch, now), velocity(moved, now[:, order])
    assert torch.allclose(first[:, order], second, atol=1e-5)
    assert torch.allclose(counts, again, atol=1e-5)


@pytest.mark.exhaustive
def test_it_learns_objects_of_a_view_and_draws_them():
    """One view by heart: draws lie where its objects are, and so many are hidden."""
    torch.manual_seed(0)
    batch = batch_of(1)
    model = SetFlow(**SMALL, share=0.0, repeats=16)
    optimizer = torch.optim.AdamW(model.parameters(), 4e-3)
    random = torch.Generator().manual_seed(0)
    for _ in range(300):
        found = model(batch, random)
        loss = FlowVelocity()(found, batch) + HiddenCount()(found, batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    drawn = model.sample(batch, 8, random)
    assert (drawn.present.sum(dim=1) == 3).all()
    errors = (drawn.positions[:, :2] - batch.positions[:, :2]).norm(dim=-1)
    assert float(errors.median()) < 0.04
    volume, true = drawn.half_axes.prod(dim=-1)[:, :2], batch.half_axes.prod(dim=-1)[:, :2]
    assert float((volume / true).log().abs().median()) < 0.5


def test_scenes_without_a_view_have_as_many_objects_as_one_asks_for():
    torch.manual_seed(0)
    model = SetFlow(**SMALL)
    first, again = (model.scenes(4, torch.Generator().manual_seed(1)) for _ in range(2))
    assert torch.equal(first.positions, again.positions)
    assert (first.present.sum(dim=1) >= 1).all()
    assert not first.seen.any()
    two = model.scenes(3, torch.Generator().manual_seed(1), objects=2)
    assert (two.present.sum(dim=1) == 2).all()
    assert two.positions.shape == (3, 2, 3)


def test_each_draw_sees_its_own_row_of_the_view():
    torch.manual_seed(0)
    model, one = SetFlow(**SMALL).eval(), batch_of(1)
    same = SetFlowBatch(
        **{name: value.repeat_interleave(2, 0) for name, value in vars(one).items()}
    )
    other = same.points.clone()
    other[1] += 0.02 * torch.randn(other[1].shape)

    def drawn(batch):
        found = model.sample(batch, 3, torch.Generator().manual_seed(0), steps=4)
        return found.half_axes * found.present[..., None]

    first, second = drawn(same), drawn(replace(same, points=other))
    moved = [not torch.equal(a, b) for a, b in zip(first, second, strict=True)]
    assert moved == [False, True, False]  # the third sees the first row again
    assert torch.allclose(first, drawn(one), atol=1e-6)


def test_sizes_below_one_are_refused():
    with pytest.raises(ConfigError, match="slots = 0"):
        SetFlow(slots=0)


def test_hidden_objects_are_drawn_beside_known_ones():
    """Slots of seen objects end where they are; those of the others differ from draw to draw."""
    torch.manual_seed(0)
    model, batch = SetFlow(**SMALL).eval(), batch_of(1)
    torch.nn.init.zeros_(model.counts[2].weight)
    with torch.no_grad():
        model.counts[2].bias.copy_(torch.tensor([-9.0, 9.0, -9.0, -9.0, -9.0])[: model.slots + 1])
    drawn = model.complete(batch, 3, 1, torch.Generator().manual_seed(0), steps=4)
    seen = batch.seen[0]
    known = int(seen.sum())
    assert drawn.present.sum(dim=1).tolist() == [known + 1] * 3
    assert drawn.seen.sum(dim=1).tolist() == [known] * 3
    for row in range(3):
        points = np.random.default_rng(0).uniform(-0.3, 0.3, (200, 3))
        for k, true in enumerate(seen.nonzero()[:, 0].tolist()):
            one, other = (
                _value(x, i, j, points) for x, i, j in ((drawn, row, k), (batch, 0, true))
            )
            assert np.allclose(one, other, rtol=2e-2, atol=1e-3)
    hidden = drawn.positions[:, known]
    assert torch.cdist(hidden, hidden)[0, 1] > 1e-3
    assert model.hidden_number(batch, torch.Generator().manual_seed(0)) == 1
    more = model.complete(batch, 3, 2, torch.Generator().manual_seed(0), steps=4)
    assert more.present.sum(dim=1).tolist() == [known + 2] * 3


def _value(batch, row, slot, points):
    """Left side of eq. 5.1 at points, the same for all descriptions of an object."""
    half, exponents = batch.half_axes[row, slot].numpy(), batch.exponents[row, slot].numpy()
    local = (points - batch.positions[row, slot].numpy()) @ batch.rotations[row, slot].numpy()
    return np.log(Superquadric(half, exponents).value(local))


def test_absent_objects_need_no_size():
    """Batches of scenes with different numbers of objects are filled up with zeros."""
    torch.manual_seed(0)
    model, batch = SetFlow(**SMALL), batch_of()
    present = batch.present.clone()
    present[1, -1] = False
    half_axes = torch.where(present[..., None], batch.half_axes, 0.0)
    padded = replace(batch, present=present, seen=batch.seen & present, half_axes=half_axes)
    found = model(padded, torch.Generator().manual_seed(0))
    loss = FlowVelocity()(found, padded)
    loss.backward()
    assert torch.isfinite(loss)
    assert all(torch.isfinite(one.grad).all() for one in model.parameters() if one.grad is not None)


def test_descriptions_are_exact_in_mixed_precision():
    numbers = torch.randn(4, 15, generator=torch.Generator().manual_seed(0))
    with torch.autocast("cpu", torch.bfloat16):
        mixed = described_in_all_ways(numbers)
    assert torch.equal(mixed, described_in_all_ways(numbers))


def test_networks_that_draw_nothing_hidden_count_nothing():
    model = SetExtents(**OF_EXTENTS)
    with pytest.raises(ConfigError, match="flow_velocity"):
        HiddenCount().check(SetFlowSetup(model.slots, model.draws_hidden))


def test_draws_spread_as_their_noise_does():
    torch.manual_seed(0)
    model = SetFlow(slots=4, width=32, layers=1, heads=2).eval()
    batch = boxes(1)

    def drawn(spread):
        found = model.sample(batch, 3, torch.Generator().manual_seed(0), 4, spread)
        return found.half_axes[:, : batch.seen.shape[1]][:, batch.seen[0]]

    same, plain, ones = drawn([0.0, 0.0, 0.0]), drawn(None), drawn([1.0, 1.0, 1.0])
    torch.testing.assert_close(plain, ones)
    mixed = drawn([0.0, 1.0, 1.0])
    torch.testing.assert_close(mixed[0], same[0])
    torch.testing.assert_close(mixed[1:], plain[1:])
    assert (plain[0] - same[0]).abs().max() > 1e-4
