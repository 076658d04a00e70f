"""How far objects go on where nothing is seen of them, and the network that draws it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.models.viewed_sets import batch_of

from scenefw.core.errors import ConfigError
from scenefw.losses.flow_velocity import FlowVelocity
from scenefw.models.set_extents import SetExtents, seen_in_axes
from scenefw.models.start_noise import start_noise
from scenefw.shapes.equal_descriptions import equal_descriptions

SMALL = {"slots": 4, "width": 32, "layers": 1, "heads": 2, "others": 4, "turn": 0.0, "ends": False}


def boxes(views=2, objects=3, seed=0):
    """Boxes of which points of the faces towards the camera are seen, and those at y > 0 hidden."""
    batch = batch_of(views, objects, seed)
    random = np.random.default_rng(seed)
    points = torch.zeros(views, objects, 24, 3)
    for view in range(views):
        for k in range(objects):
            turn = batch.rotations[view, k].double().numpy()
            half, centre = batch.half_axes[view, k].numpy(), batch.positions[view, k].numpy()
            eye = (batch.camera[view].numpy() - centre) @ turn
            local = random.uniform(-1, 1, (24, 3))
            axis = np.arange(24) % 3
            local[np.arange(24), axis] = np.where(eye > 0, 1, -1)[axis]
            points[view, k] = torch.from_numpy((local * half) @ turn.T + centre)
    seen = batch.seen
    return replace(batch, points=points * seen[..., None, None])


def test_all_24_descriptions_of_an_object_give_the_same_axes():
    batch = boxes()
    first = seen_in_axes(batch, batch.rotations)
    for way in equal_descriptions():
        again = seen_in_axes(batch, batch.rotations @ way)
        for one, other in zip(first[:3], again[:3], strict=True):
            assert torch.allclose(one[batch.seen], other[batch.seen], atol=1e-5)
    axes, low, high, _ = first
    ahead = batch.camera[:, None] - batch.points.mean(dim=2)
    agreement = torch.einsum("bnki,bni->bnk", axes, ahead)[batch.seen]
    assert (agreement >= 0).all()
    assert (agreement.diff(dim=-1) <= 0).all()
    assert (low <= high).all()


def test_what_is_learnt_says_the_object():
    """Numbers of the training, drawn by a network that is sure of them, are the object again."""
    torch.manual_seed(0)
    batch, model = boxes(1), SetExtents(**SMALL)
    targets = []

    def exactly(now, time, memory, seen):
        # The straight path from here to the numbers that training aims at
        return (targets[0] - now) / (1 - time[:, None, None])

    def learnt(now, time, memory, seen):
        targets.append(now)
        return torch.zeros_like(now)

    model.repeats = 1
    model.velocity_of = learnt
    training = model(batch, torch.Generator().manual_seed(1))
    random = torch.Generator().manual_seed(1)
    torch.randn(1, 3, 3, generator=random)
    time = torch.rand(1, generator=random)[:, None, None]
    noise = torch.randn(1, 3, 9, generator=random)
    assert torch.allclose(targets.pop(), (1 - time) * noise + time * (training.target + noise))
    targets.append(training.target + noise)
    model.velocity_of = exactly
    drawn = model.sample(batch, 3, random, steps=4)
    seen = batch.seen[0]
    for name in ("half_axes", "exponents", "rotations", "positions"):
        wanted = getattr(batch, name)[0, seen]
        found = getattr(drawn, name)[:, seen]
        assert torch.allclose(found, wanted.expand_as(found), rtol=1e-3, atol=1e-4), name


def test_no_order_among_objects_and_nothing_from_the_unseen():
    torch.manual_seed(0)
    model, batch = SetExtents(**SMALL).eval(), boxes()
    order = torch.tensor([2, 0, 1])
    moved = replace(batch, **{n: x[:, order] for n, x in vars(batch).items() if n != "camera"})

    def tokens(one):
        axes, low, high, _ = seen_in_axes(one, one.rotations)
        return model.encode(one, axes, low, high)

    first = tokens(batch)
    assert torch.allclose(first[:, order][moved.seen], tokens(moved)[moved.seen], atol=1e-5)
    away = torch.where(batch.seen[..., None, None], batch.points, 9.0)
    changed = tokens(replace(batch, points=away))
    assert torch.allclose(first[batch.seen], changed[batch.seen], atol=1e-5)
    near = batch.points.clone()
    near[1, 0] += 0.05
    changed = tokens(replace(batch, points=near))
    assert not torch.allclose(first[1, 1], changed[1, 1], atol=1e-3)  # sees its neighbour


def test_it_learns_hidden_faces_of_a_view():
    torch.manual_seed(0)
    batch = boxes(1)
    model = SetExtents(**{**SMALL, "repeats": 16})
    optimizer = torch.optim.AdamW(model.parameters(), 4e-3)
    random = torch.Generator().manual_seed(0)
    for _ in range(200):
        found = model(batch, random)
        optimizer.zero_grad()
        FlowVelocity()(found, batch).backward()
        optimizer.step()
    drawn = model.sample(batch, 8, random)
    seen = batch.seen[0]
    errors = (drawn.half_axes - batch.half_axes)[:, seen].abs()
    assert float(errors.median()) < 0.006
    assert torch.equal(drawn.present, batch.seen.expand(8, -1))


def test_each_draw_sees_its_own_row_of_the_view():
    torch.manual_seed(0)
    model, one = SetExtents(**SMALL).eval(), boxes(1)
    same = replace(
        one, **{name: value.repeat_interleave(2, 0) for name, value in vars(one).items()}
    )
    other = same.points.clone()
    other[1, one.seen[0]] += 0.01 * torch.randn(other[1, one.seen[0]].shape)

    def drawn(batch):
        return model.sample(batch, 3, torch.Generator().manual_seed(0), steps=4).half_axes

    first, second = drawn(same), drawn(replace(same, points=other))
    moved = [not torch.equal(a, b) for a, b in zip(first, second, strict=True)]
    assert moved == [False, True, False]  # the third sees the first row again
    assert torch.allclose(first, drawn(one), atol=1e-6)


def test_numbers_out_of_range_are_refused():
    with pytest.raises(ConfigError, match="heads = 0"):
        SetExtents(heads=0, ends=False)


def test_ends_of_images_add_nothing_before_training_and_count_after_it():
    torch.manual_seed(0)
    plain = SetExtents(**SMALL)
    model = SetExtents(**{**SMALL, "ends": True})
    assert not model.load_state_dict(plain.state_dict(), strict=False).unexpected_keys
    batch = boxes()
    axes, low, high, _ = seen_in_axes(batch, batch.rotations)

    def tokens(network, one):
        return network.encode(one, axes, low, high)[batch.seen]

    assert torch.equal(tokens(plain, batch), tokens(model, batch))
    torch.nn.init.normal_(model.ends[1].weight)
    hidden = replace(batch, ends=batch.ends * torch.tensor([1.0] * 6 + [-1.0]))
    without = replace(batch, ends=torch.zeros_like(batch.ends))
    assert not torch.allclose(tokens(model, batch), tokens(model, hidden), atol=1e-3)
    assert not torch.allclose(tokens(model, batch), tokens(model, without), atol=1e-3)
    order = torch.randperm(batch.ends.shape[2])
    again = replace(batch, ends=batch.ends[:, :, order])
    assert torch.allclose(tokens(model, batch), tokens(model, again), atol=1e-5)


def test_what_is_learnt_keeps_its_millimetres_in_mixed_precision():
    batch, model = boxes(), SetExtents(**{**SMALL, "turn": 5.0})
    aims = []
    for mixed in (False, True):
        with torch.autocast("cpu", torch.bfloat16, enabled=mixed):
            aims.append(model(batch, torch.Generator().manual_seed(0)).target)
    assert torch.equal(*aims)


def test_draws_spread_as_their_noise_does():
    torch.manual_seed(0)
    model = SetExtents(**SMALL).eval()
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
    torch.testing.assert_close(same[1:], same[:1].expand(2, -1, -1))


def test_noise_has_the_deviation_of_its_draw():
    noise = start_noise((3, 50, 40), torch.Generator().manual_seed(0), [0.0, 1.0, 2.0])
    np.testing.assert_allclose(noise.std(dim=(1, 2)), [0, 1, 2], atol=0.06)
