"""Draws of whole scenes: networks that know, and one that knows nothing."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image
from scipy.spatial.transform import Rotation

from scenefw.core.batches import IndexBatch, SceneParameters
from scenefw.core.errors import ConfigError
from scenefw.core.set_flows import SetFlowBatch
from scenefw.core.types import GridSpec, Pose, SceneObject
from scenefw.data.batches.set_flow import SetFlowViews
from scenefw.data.batches.stacks import StackScenes
from scenefw.learning.checkpoint import Checkpoint
from scenefw.report.blocks import Picture
from scenefw.report.presentation import Chapter
from scenefw.scenes.cameras import RandomViewpoints
from scenefw.shapes.superquadric import Superquadric
from scenefw_scene_prior.evaluation import SetPriorEvaluation
from scenefw_scene_prior.left_to_gravity import Gravity, objects_of
from scenefw_scene_prior.network import SetFlow
from scenefw_scene_prior.references import jittered, shuffled
from scenefw_scene_prior.results import share_interval
from scenefw_scene_prior.scene_numbers import (
    descriptor,
    nearest_scene,
    object_numbers,
    quantities,
    shared_volume,
)
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine

pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")

TINY = {"slots": 8, "width": 16, "layers": 1, "view_layers": 1, "heads": 2}
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def block(position, size=(0.1, 0.1, 0.1), quaternion=UPRIGHT):
    shape = Superquadric(np.array(size) / 2, np.full(3, 80.0))
    return SceneObject(shape, Pose(np.array(position, dtype=float), np.array(quaternion)), 1.0)


class Knowing(torch.nn.Module):
    """Draws true scenes, of the training split if it is given nothing, raised by `up`."""

    draws_hidden = True

    def __init__(self, scenes, up=0.0):
        super().__init__()
        self.still = torch.nn.Parameter(torch.zeros(1))
        self.true, self.up = scenes, up

    def sample(self, batch, count, generator, steps=20, spread=None):
        batch = SetFlowBatch(*(field.expand(count, *field.shape[1:]) for field in
                               vars(batch).values()))  # fmt: skip
        return replace(batch, positions=batch.positions + torch.tensor([0, 0, self.up]))

    def scenes(self, count, generator, steps=20, objects=None):
        known = self.true.parameters(range(len(self.true)))
        rows = torch.arange(len(self.true))
        if objects is not None:
            rows = rows[known.present.sum(dim=1) == objects]
        rows = rows[torch.randint(len(rows), (count,), generator=generator)]
        true = self.true.parameters(rows)
        points = torch.zeros(*true.present.shape, 4, 3)
        return SetFlowBatch(
            points, torch.zeros_like(true.present), points[..., 0, 0],
            torch.zeros(*true.present.shape, 4, 7), torch.zeros(count, 3),
            true.half_axes, true.exponents, true.rotations,
            true.positions + torch.tensor([0.3, 0, self.up]), true.present,
        )  # fmt: skip


def evaluation(data, model, scenes, **settings):
    checkpoint = Checkpoint(model, None, {}, {})
    engine = PyBulletEngine(gravity=10.0)
    return SetPriorEvaluation(
        checkpoint, data, scenes, engine, physics_steps=600, steps=3, **settings
    )


@pytest.fixture(scope="module")
def data():
    return SetFlowViews(RandomViewpoints(), "stacks_v2", image_size=(48, 36), points=8, least=1)


@pytest.fixture(scope="module")
def scenes():
    return StackScenes("stacks_v2", "val", 16)


@pytest.fixture(scope="module")
def known(data, scenes):
    return evaluation(data, Knowing(data.scenes), scenes, examples=0).run()


def test_a_perfect_sampler_passes_all_tests(known):
    figures = known.figures
    for kind in ("drawn", "given", "truth"):
        assert figures[f"{kind}/stable"] == 1
        assert figures[f"{kind}/sunk"] < 0.002
    assert figures["stable_ratio"] == 1
    assert figures["given/energy"] < 0.01  # the same scenes
    assert figures["drawn/energy_low"] < 0 < figures["drawn/energy_high"]
    assert figures["drawn/chance"] > 0.01
    assert figures["drawn/novelty"] == pytest.approx(0, abs=1e-5)  # it copies
    assert figures["novelty_ratio"] < 0.01
    assert figures["truth/novelty"] > 0.1
    assert figures["given/count_gap"] == 0


def test_references_that_learn_nothing_fail_them(known):
    figures = known.figures
    assert figures["shuffled/stable"] < 0.8
    assert figures["shuffled/chance"] < 0.05
    assert figures["shuffled/penetration"] > 5 * figures["jittered/penetration"]
    assert figures["jittered/penetration"] > figures["truth/penetration"]
    assert figures["shuffled/energy"] > figures["jittered/energy"]
    measures = known.measures
    assert measures["drawn/stable"].trivial == "shuffled/stable"
    assert measures["drawn_at_rest/stable"].trivial == "shuffled_at_rest/stable"
    assert measures["truth/stable"].trivial is None
    assert figures.keys() <= {*measures, *(f"{name}{end}" for name in measures
                                           for end in ("_low", "_high"))}  # fmt: skip


def test_what_falls_is_drawn_anew_with_as_many_objects():
    """A leaning tower falls; a block beside another stands, and what is sunk comes up."""
    engine = PyBulletEngine(gravity=10.0)
    gravity = Gravity(engine, 600, furthest=0.05, steepest=30.0)
    falls = [(0, 0, 0.05), (0.08, 0, 0.15)]
    stands = [(0, 0, 0.05), (0.3, 0, 0.04)]
    asked = []

    def draw(scenes, objects):
        asked.append((scenes, objects))
        places = [falls, stands][min(len(asked) - 1, 1)]
        return set_of([places[:objects]] * scenes)

    found = gravity.at_rest(draw, [2, 2, 2])
    assert asked == [(3, 2), (3, 2)]
    assert found.present.sum(dim=1).tolist() == [2, 2, 2]
    assert found.positions[0, :, 2].tolist() == pytest.approx([0.05, 0.05], abs=2e-3)
    assert all(gravity.stands(gravity.motions(objects_of(found, row))) for row in range(3))
    asked.clear()
    lying = gravity.at_rest(lambda scenes, _: set_of([falls] * scenes), [2], attempts=1)
    assert lying.positions[0, 1, 2] < 0.1  # as it came to lie


def set_of(places):
    """Scenes of blocks of 10 cm."""
    positions = torch.tensor(places, dtype=torch.float32)
    shape = positions.shape
    return SceneParameters(
        torch.full(shape, 0.05), torch.full(shape, 80.0),
        torch.eye(3).expand(*shape[:2], 3, 3), positions, torch.ones(shape[:2], dtype=torch.bool),
    )  # fmt: skip


@pytest.mark.exhaustive
def test_raised_scenes_are_found_out(data, scenes):
    few = StackScenes("stacks_v2", "val", 4)
    figures = evaluation(data, Knowing(data.scenes, up=0.3), few, examples=0).run().figures
    assert figures["drawn/stable"] == figures["given/stable"] == 0
    assert figures["given/height_gap"] == pytest.approx(0.3, abs=1e-4)


@pytest.mark.exhaustive
def test_an_untrained_network_gives_a_page(data, tmp_path, monkeypatch):
    monkeypatch.setattr("scenefw_scene_prior.report.prior._GRID", GridSpec(32))
    monkeypatch.setattr("scenefw_scene_prior.report.prior._TILE", (56, 42))
    torch.manual_seed(0)
    model = SetFlow(**TINY).eval()
    few = StackScenes("stacks_v2", "val", 3)
    result = evaluation(data, model, few, examples=1).run()
    assert result.split == "val"
    assert 1 <= result.figures["drawn/count"] <= 8
    sections = Chapter("scenefw_scene_prior.report").sections(result, tmp_path)
    tests, made, drawn = sections
    table = tests.blocks[0]
    assert [name for name, _ in table.rows][:3] == [
        "drawn without a view", "drawn without a view, pushed apart",
        "drawn without a view, at rest",
    ]  # fmt: skip
    assert all(len(one.rows) >= 5 for one in made.blocks[:2])
    assert "<svg" in made.blocks[2].svg
    assert len(drawn.blocks) == 4  # three kinds and a view
    for picture in drawn.blocks:
        assert isinstance(picture, Picture)
        with Image.open(tmp_path / picture.path) as image:
            assert np.asarray(image).std() > 5
    again = evaluation(data, model, few, examples=0).run()
    assert again.figures == result.figures


def test_single_scenes_leave_out_what_needs_several(data):
    one = StackScenes("stacks_v2", "val", 1)
    figures = evaluation(data, Knowing(data.scenes), one, examples=0).run().figures
    assert "drawn/energy" not in figures
    assert figures["scenes"] == 1
    assert all(np.isfinite(value) for value in figures.values())


def test_networks_that_draw_no_scenes_are_refused(data, scenes):
    model = Knowing(data.scenes)
    model.draws_hidden = False
    with pytest.raises(ConfigError, match="draws nothing without a view"):
        evaluation(data, model, scenes)
    with pytest.raises(ConfigError, match="shift = -1"):
        evaluation(data, Knowing(data.scenes), scenes, shift=-1)


def test_views_of_another_split_are_those_of_validation(data):
    scenes = StackScenes("stacks_v2", "val", 64)
    ours = data.views_of(scenes, [0, 5])
    theirs = data.validation_batch(IndexBatch(0, torch.tensor([0, 5])), torch.device("cpu"))
    assert torch.equal(ours.points, theirs.points)
    assert torch.equal(ours.positions, theirs.positions)


def test_objects_that_are_not_finite_are_left_out(data, scenes):
    class Broken(Knowing):
        def sample(self, *words):
            made = super().sample(*words)
            axes = made.half_axes.clone()
            axes[:, 0], axes[:, 1] = float("nan"), 50.0
            return replace(made, half_axes=axes)

    one = StackScenes("stacks_v2", "val", 1)
    figures = evaluation(data, Broken(data.scenes), one, examples=0).run().figures
    true = evaluation(data, Knowing(data.scenes), one, examples=0).run().figures
    assert figures["given/count"] == true["given/count"] - 1


def test_what_two_blocks_share():
    a, b = block((0, 0, 0.05)), block((0.06, 0.0, 0.08))
    assert shared_volume(a, b) == pytest.approx(0.04 * 0.1 * 0.07, rel=0.1)
    assert shared_volume(a, block((0.3, 0, 0.05))) == 0
    found = quantities([a, b, block((0.4, 0, 0.03))])
    assert found["count"] == [3]
    np.testing.assert_allclose(found["height"], [0.05, 0.08, 0.03])
    np.testing.assert_allclose(found["sunk"], 0.02, atol=1e-9)
    np.testing.assert_allclose(found["volume"], 0.001, rtol=0.1)
    np.testing.assert_allclose(sorted(found["distance"]), [np.hypot(0.06, 0.03), 0.34366,
                                                           0.40050], atol=1e-4)  # fmt: skip


def test_numbers_of_a_scene_do_not_depend_on_where_it_stands(scenes):
    scene = objects_of(scenes.parameters([2]), 0)
    turn = Rotation.from_euler("z", 70, degrees=True)
    moved = []
    for item in scene:
        matrix = item.pose.matrix
        matrix[:3, :3] = turn.as_matrix() @ matrix[:3, :3]
        matrix[:3, 3] = turn.apply(matrix[:3, 3]) + (0.2, -0.1, 0)
        moved.append(SceneObject(item.shape, Pose.from_matrix(matrix), item.mass))
    np.testing.assert_allclose(descriptor(moved[::-1]), descriptor(scene), atol=1e-3)
    assert not np.allclose(descriptor(scene), descriptor(scene[1:]), atol=1e-2)
    assert (descriptor(()) == 0).all()
    assert np.isfinite(descriptor(scene[:1])).all()


def test_the_nearest_scene_is_itself_in_any_order(scenes):
    every = scenes.parameters(list(range(16)))
    known = object_numbers(every)
    flipped = SceneParameters(*(field.flip(1) for field in vars(every).values()))
    np.testing.assert_allclose(nearest_scene(object_numbers(flipped), known), 0, atol=1e-6)
    larger = replace(every, half_axes=every.half_axes * 1.3)
    found = nearest_scene(object_numbers(larger), known)
    assert (found[np.isfinite(found)] > 0.05).all()
    nothing = replace(every, present=torch.zeros_like(every.present))
    assert np.isnan(nearest_scene(object_numbers(nothing), known)).all()


def test_shuffled_scenes_keep_each_number_and_lose_how_they_belong_together(data):
    training = data.scenes.parameters(list(range(400)))
    made = shuffled(training, 400, np.random.default_rng(0))
    for name in ("half_axes", "rotations"):
        ours, theirs = getattr(made, name)[made.present], getattr(training, name)[training.present]
        known = {tuple(row) for row in theirs.flatten(1).tolist()}
        assert all(tuple(row) in known for row in ours.flatten(1).tolist())
    counts, true = (one.present.sum(dim=1).float().mean() for one in (made, training))
    assert abs(counts - true) < 0.1
    heights, known = (one.positions[..., 2][one.present] for one in (made, training))
    assert abs(heights.mean() - known.mean()) < 0.01


def test_jitter_is_as_large_as_it_says(scenes):
    true = scenes.parameters(list(range(16)))
    made = jittered(true, 0.01, 5.0, np.random.default_rng(0))
    moves = (made.positions - true.positions)[true.present]
    assert moves.std() == pytest.approx(0.01, rel=0.2)
    relative = made.rotations @ true.rotations.transpose(-1, -2)
    angles = Rotation.from_matrix(relative[true.present].numpy()).magnitude()
    assert np.degrees(np.sqrt((angles**2).mean())) == pytest.approx(5, rel=0.25)


def test_shares_have_wilsons_bounds():
    found = share_interval(np.array([True] * 9 + [False]))
    assert (found.mean, found.low, found.high) == pytest.approx((0.9, 0.5958, 0.9821), abs=1e-3)
    assert np.isnan(share_interval(np.zeros(0, bool)).mean)


@pytest.mark.exhaustive
def test_a_network_that_draws_no_scenes_is_one_line(scenefw):
    done = scenefw("experiment=set_prior", "debug=smoke", "checkpoints.set_flow=set_extents")
    assert done.returncode == 2
    assert "draws nothing without a view" in done.stderr.splitlines()[-1]
