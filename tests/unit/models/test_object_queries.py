"""The decoder of sets: what it sees, what it doesn't depend on, and what it refuses."""

from dataclasses import fields, replace

import pytest
import torch
from tests.unit.models.queries import SIZES, batch_of, encoder, queries

from scenefw.core.errors import ConfigError
from scenefw.models.farthest_points import farthest_points
from scenefw.models.object_queries import ObjectQueries, seen_from

GEOMETRY = ("existence", "half_axes", "exponents", "rotations", "positions")


def same(one, other, atol=1e-4):
    return all(
        torch.allclose(getattr(one, name), getattr(other, name), atol=atol) for name in GEOMETRY
    )


def test_farthest_points_are_far_apart_whatever_their_order():
    points = torch.randn(2, 50, 3)
    seen = torch.rand(2, 50) < 0.6
    which, counted = farthest_points(points, seen, 40)
    assert seen.gather(1, which)[counted].all()
    assert torch.equal(counted.sum(dim=1), seen.sum(dim=1).clamp_max(40))
    assert torch.equal(which[:, :5], farthest_points(points, seen, 5)[0])
    order = torch.randperm(50)
    again, _ = farthest_points(points[:, order], seen[:, order], 5)
    assert torch.equal(order[again], which[:, :5])
    spread = points.gather(1, which[:, :5, None].expand(-1, -1, 3))
    gaps = torch.cdist(spread, spread) + 9 * torch.eye(5)
    near = torch.cdist(points[:, :5], points[:, :5]) + 9 * torch.eye(5)
    assert (gaps.amin(dim=(1, 2)) > near.amin(dim=(1, 2))).all()


def test_every_layer_gives_solids_within_bounds():
    model, batch = queries(), batch_of()
    layers = model(batch).layers
    assert len(layers) == SIZES["layers"]
    for found in layers:
        assert found.existence.shape == (2, 6)
        assert torch.allclose(torch.linalg.det(found.rotations), torch.tensor(1.0), atol=1e-5)
        assert ((found.half_axes > 0.008) & (found.half_axes < 0.45)).all()
        assert ((found.exponents >= 2) & (found.exponents < 100)).all()
        starts = model.view(batch.condition, batch.points, batch.seen).places[:, :4]
        assert (found.positions[:, :4] - starts).norm(dim=-1).max() < 0.05
    first = same(layers[-1], model.predict(batch.condition, batch.points, batch.seen))
    assert first


def test_it_does_not_depend_on_the_order_of_points_nor_on_what_does_not_count():
    model, batch = queries().eval(), batch_of()
    first = model.predict(batch.condition, batch.points, batch.seen)
    order = torch.randperm(batch.points.shape[1])
    assert same(first, model.predict(batch.condition, batch.points[:, order], batch.seen[:, order]))
    away = torch.where(batch.seen[..., None], batch.points, 7.0)
    assert same(first, model.predict(batch.condition, away, batch.seen))


def test_free_queries_have_no_order():
    """Swapping what was learnt of two swaps what they find, and nothing else."""
    model, batch = queries().eval(), batch_of()
    first = model.predict(batch.condition, batch.points, batch.seen)
    with torch.no_grad():
        model.free.copy_(model.free.flip(0))
        model.starts.copy_(model.starts.flip(0))
    other = model.predict(batch.condition, batch.points, batch.seen)
    order = torch.tensor([0, 1, 2, 3, 5, 4])
    moved = replace(other, **{name: getattr(other, name)[:, order] for name in GEOMETRY})
    assert same(first, moved)


def test_views_do_not_see_each_other():
    model, batch = queries().eval(), batch_of()
    both = model.predict(batch.condition, batch.points, batch.seen)
    alone = model.predict(batch.condition[1:], batch.points[1:], batch.seen[1:])
    assert torch.allclose(both.positions[1:], alone.positions, atol=1e-5)


def test_an_empty_view_leaves_queries_for_hidden_objects():
    model, batch = queries(), batch_of()
    found = model(replace(batch, seen=torch.zeros_like(batch.seen))).layers[-1]
    assert not found.active[:, :4].any()
    assert found.active[:, 4:].all()
    for one in fields(found)[:5]:
        assert torch.isfinite(getattr(found, one.name)).all()
    (found.positions.sum() + found.existence.sum()).backward()
    grads = [p.grad for p in model.parameters() if p.grad is not None]
    assert all(torch.isfinite(grad).all() for grad in grads)


def test_it_is_rebuilt_from_its_recipe():
    model, batch = queries(), batch_of()
    recipe = dict(model.recipe)
    assert recipe.pop("_target_").endswith("ObjectQueries")
    again = ObjectQueries(**recipe)
    assert again.recipe == model.recipe
    assert again.grid == model.grid
    again.load_state_dict(model.state_dict())
    args = (batch.condition, batch.points, batch.seen)
    assert same(model.eval().predict(*args), again.eval().predict(*args), 1e-6)


@pytest.mark.parametrize("frozen", [True, False])
def test_the_encoder_is_the_trained_one_and_stays_so_if_frozen(frozen):
    model, batch = queries(frozen=frozen), batch_of()
    trained = encoder().model.condition.layers.state_dict()
    own = model.view.encoder.state_dict()
    assert all(torch.equal(own[name], value) for name, value in trained.items())
    model.train()
    model(batch).layers[-1].positions.sum().backward()
    after = model.view.encoder.state_dict()
    assert all(torch.equal(after[name], value) for name, value in trained.items()) == frozen
    assert all((p.grad is None) == frozen for p in model.view.encoder.parameters())


def test_what_means_nothing_is_refused_in_one_line():
    other = encoder()
    other.recipe = {"_target_": "scenefw.models.sscnet.SSCNet", "resolution": 16}
    cases = (
        ({"heads": 0}, "heads 0"), ({"seeded": 20}, "as many tokens"), ({"width": 33}, "divide"),
        ({"encoder": other}, "model=shape_instance_vae"),
    )  # fmt: skip
    for changed, words in cases:
        with pytest.raises(ConfigError, match=words) as caught:
            ObjectQueries(**{"encoder": encoder(), **SIZES, "heads": 2, **changed})
        assert "\n" not in str(caught.value)


def test_places_are_told_exactly_in_mixed_precision():
    batch = batch_of()
    objects = queries()(batch).layers[0]
    exact = seen_from(objects, batch.points)
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(seen_from(objects, batch.points), exact)
