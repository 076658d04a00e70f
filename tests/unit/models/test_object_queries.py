"""The decoder of sets: what it sees, what it doesn't depend on, and what it refuses."""

from dataclasses import fields, replace

import pytest
import torch
from tests.unit.models.queries import (
    SIZES,
    batch_of,
    encoder,
    image_batch_of,
    image_queries,
    queries,
)

from scenefw.core.errors import ConfigError
from scenefw.learning.object_queries import matched
from scenefw.losses.query_distance import QueryDistance
from scenefw.losses.query_existence import QueryExistence
from scenefw.models.farthest_points import farthest_points
from scenefw.models.object_queries import ObjectQueries, seen_from
from scenefw.models.query_numbers import Noised, noised

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


IMAGE_SIZES = [(32, 64), (96, 128)]


@pytest.mark.parametrize("size", IMAGE_SIZES)
def test_images_give_tokens_of_cells_and_coarse_ones(size):
    model, batch = image_queries(), image_batch_of(size=size)
    tokens = model.view(batch.condition, batch.points, batch.seen)
    coarse = size[0] * size[1] // 32**2
    assert tokens.features.shape == (2, SIZES["tokens"] + coarse, SIZES["width"])
    assert tokens.counted[:, SIZES["tokens"] :].all()
    assert same(model(batch).layers[-1], model.predict(batch.condition, batch.points, batch.seen))


def test_tokens_are_read_off_the_cell_whose_place_they_have():
    """What changes in the image most changes the token of that cell, before tokens are mixed."""
    model, batch = image_queries(tokens=12, seeded=4).eval(), image_batch_of(size=(32, 64))
    for coarser in model.view.lateral[1:]:  # these see far
        torch.nn.init.zeros_(coarser.weight)
    given = []
    model.view.mixed.register_forward_pre_hook(lambda _, arguments: given.append(arguments[0]))
    model.view(batch.condition, batch.points, batch.seen)
    which, _ = farthest_points(batch.points, batch.seen, 12)
    for token in (0, 5, 11):
        row, column = int(which[0, token]) // 16, int(which[0, token]) % 16
        changed = batch.condition.clone()
        changed[0, :, 4 * row : 4 * row + 4, 4 * column : 4 * column + 4] += 2
        model.view(changed, batch.points, batch.seen)
        differences = (given[-1] - given[0])[0, :12].norm(dim=-1)
        assert int(which[0, differences.argmax()]) == int(which[0, token])


def test_coarse_tokens_lie_in_the_middle_of_what_is_seen_there():
    model, batch = image_queries(), image_batch_of(size=(32, 64))
    places = model.view(batch.condition, batch.points, batch.seen).places[:, SIZES["tokens"] :]
    for view in range(2):
        for k in range(2):
            part = torch.zeros(8, 16, dtype=torch.bool)
            part[:, 8 * k : 8 * k + 8] = True
            inside = part.flatten() & batch.seen[view]
            expected = batch.points[view][inside].mean(dim=0) if inside.any() else torch.zeros(3)
            assert torch.allclose(places[view, k], expected, atol=1e-5)


def test_a_network_of_images_is_rebuilt_from_its_recipe_and_has_no_grid():
    model, batch = image_queries(denoised=2), image_batch_of()
    recipe = dict(model.recipe)
    recipe.pop("_target_")
    again = ObjectQueries(**recipe)
    assert again.recipe == model.recipe
    assert again.grid is None
    assert again.sees == "image"
    again.load_state_dict(model.state_dict())
    args = (batch.condition, batch.points, batch.seen)
    assert same(model.eval().predict(*args), again.eval().predict(*args), 1e-6)


@pytest.mark.parametrize("made", [
    (queries, batch_of), (image_queries, image_batch_of),
])  # fmt: skip
def test_denoised_queries_change_nothing_for_the_others(made):
    make, views = made
    batch = views()
    plain = make(denoised=0).eval()
    model = make(denoised=2).eval()
    assert model.load_state_dict(plain.state_dict(), strict=False).missing_keys == ["noised"]
    found = model(batch, torch.Generator().manual_seed(1))
    for one, other in zip(found.layers, plain(batch).layers, strict=True):
        assert same(one, other, 1e-6)
    assert len(found.denoised) == SIZES["layers"]
    assert len(found.taught) == 2 * SIZES["layers"]
    assert not plain(batch, torch.Generator()).denoised
    assert not model(batch).denoised


def test_groups_of_denoised_queries_do_not_see_each_other():
    """What a group finds is what it finds alone."""
    model, batch = queries(denoised=2).eval(), batch_of()
    both = model(batch, torch.Generator().manual_seed(1)).denoised[-1]
    start = noised(batch.scenes, 2, torch.Generator().manual_seed(1))
    tokens = model.view(batch.condition, batch.points, batch.seen)
    alone = Noised(*(one.unflatten(0, (2, 2))[:, 1] for one in start))
    last = model._sets(model._near_truth(alone), tokens)[-1]
    assert torch.allclose(both.positions[:, 6:], last.positions, atol=1e-5)
    assert torch.equal(both.matched[:, 6:], alone.objects)


def test_far_starts_are_not_where_another_object_is():
    """Of two objects side by side, what lies too far from one may be the other."""
    close = replace(batch_of().scenes, positions=torch.tensor(
        [[[0.0, 0, 0.1], [0.08, 0, 0.1], [0.04, 0.07, 0.1]]] * 2))  # fmt: skip
    start = noised(close, 40, torch.Generator().manual_seed(0))
    gaps = torch.cdist(start.starts, close.positions.repeat_interleave(40, dim=0))
    present = close.present.repeat_interleave(40, dim=0)[:, None]
    least = torch.where(present, gaps, 9.0).amin(dim=-1)
    far = torch.arange(6)[None] >= 3
    own = close.present.repeat(1, 2).repeat_interleave(40, dim=0)
    assert torch.equal(start.active, own & (~far | (least >= 0.04)))
    assert 0.05 < (own & far & ~start.active).float().sum() / (own & far).float().sum() < 0.6


@pytest.mark.parametrize("made", [(queries, batch_of), (image_queries, image_batch_of)])
@pytest.mark.parametrize("denoised", [0, 1])
def test_all_weights_learn_and_empty_scenes_do_no_harm(made, denoised):
    make, views = made
    model, batch = make(denoised=denoised), views()
    scenes = replace(batch.scenes, present=batch.scenes.present & torch.tensor([[True], [False]]))
    batch = replace(batch, scenes=scenes)
    found = matched(model(batch, torch.Generator().manual_seed(0)), batch, dense=True)
    total = sum(loss(found, batch) for loss in (QueryExistence(), QueryDistance()))
    total.backward()
    for name, weights in model.named_parameters():
        if weights.requires_grad:
            assert weights.grad is not None, name
            assert torch.isfinite(weights.grad).all(), name


def test_denoised_queries_are_near_their_objects_or_say_that_nothing_is_there():
    model, batch = queries(denoised=3), batch_of()
    found = model(batch, torch.Generator().manual_seed(0)).denoised[0]
    matched = found.matched
    present = batch.scenes.present
    assert found.existence.shape == (2, 18)
    assert torch.equal((found.active & (matched >= 0)).sum(dim=1), 3 * present.sum(dim=1))
    for view in range(2):
        for k in range(matched.shape[1]):
            owner = int(matched[view, k])
            gaps = (batch.scenes.positions[view] - found.starts[view, k]).norm(dim=-1)
            if owner >= 0:
                assert present[view, owner]
                assert gaps[owner] < 0.07
            elif found.active[view, k]:
                assert gaps[present[view]].min() >= 0.04
    assert int((matched >= 0).sum()) == 3 * int(present.sum())


def test_image_encoders_of_no_size_are_refused():
    cases = (
        ({"widths": [8, 8, 8]}, "widths"), ({"widths": [8, 8, 8, 9]}, "widths"), ({}, "widths"),
        ({"widths": 64}, "widths"), ({"sees": "images"}, "expected image"),
        ({"widths": [8, 8, 8, 8], "depth": 3}, "has depth"),
    )  # fmt: skip
    for wrong, words in cases:
        with pytest.raises(ConfigError, match=words) as caught:
            ObjectQueries({"sees": "image", **wrong}, **SIZES, heads=2)
        assert "\n" not in str(caught.value)
    with pytest.raises(ConfigError, match="denoised"):
        image_queries(denoised=-1)
