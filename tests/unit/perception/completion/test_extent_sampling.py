"""Draws of a network as what is expected of hidden parts, and as hidden objects."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import torch
from tests.unit.perception.evidence.test_gathering import view_of
from tests.unit.perception.synthetic import STACK, camera_at

from scenefw import registry
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.set_flows import SeenSetBatch
from scenefw.core.types import Pose
from scenefw.data.view_samples import ObjectSamples
from scenefw.fitting.joint import JointFit
from scenefw.fitting.placed import shape_of, signed_distance
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.completion.extent_inputs import SeenObjects, along
from scenefw.perception.completion.extent_sampling import DrawnSets
from scenefw.perception.completion.hidden_objects import HiddenObjects
from scenefw.perception.evidence.gathering import EvidenceOfView
from scenefw.perception.observation.free_space import places_in, seen_through, surely_free
from scenefw.shapes.equal_descriptions import equal_descriptions


class Told(torch.nn.Module):
    """Draws what it is told: boxes (S, N, 2, 3), centres and half-axes, in the frame of the view.

    Draw k has boxes k. Those after the seen objects are hidden ones.
    """

    draws_hidden = True

    def __init__(self, boxes):
        super().__init__()
        self.boxes = torch.as_tensor(np.array(boxes), dtype=torch.float32)
        self.any = torch.nn.Parameter(torch.zeros(1))

    def sample(self, batch, count, generator, steps=20, spread=None):
        self.shown = batch
        boxes = self.boxes.expand(count, -1, -1, -1)
        slots = boxes.shape[1]
        return SeenSetBatch(
            torch.zeros(count, slots, 4, 3), torch.ones(count, slots, dtype=torch.bool),
            torch.zeros(count, slots), torch.zeros(count, slots, 4, 7), torch.zeros(count, 3),
            boxes[:, :, 1],
            torch.full((count, slots, 3), 20.0), torch.eye(3).expand(count, slots, 3, 3),
            boxes[:, :, 0], torch.ones(count, slots, dtype=torch.bool),
        )  # fmt: skip

    hidden = 1

    def hidden_number(self, batch, generator):
        return self.hidden

    def complete(self, batch, count, objects, generator, steps=20):
        """The first of its hidden boxes alone, if it is asked for less of them."""
        self.known = batch
        found = self.sample(batch, count, generator, steps)
        left = torch.arange(found.present.shape[1]) < found.present.shape[1] - self.hidden + objects
        return replace(found, present=found.present & left)


@dataclass
class Loaded:
    model: Told
    metadata: dict = field(default_factory=lambda: {"made": "by hand"})


@dataclass
class Inner:
    grid = None
    metadata: dict = field(default_factory=dict)


def method(boxes, **settings):
    fit = JointFit(SuperquadricFit())
    return DrawnSets(Inner(), fit, EvidenceOfView(), Loaded(Told(boxes)), **settings)


def seen():
    """The fronts of two boxes: their backs are hidden, and no predicted volume says where."""
    view, camera = view_of(48), camera_at(eye=(0.0, -0.85, 0.6))
    masks = np.where(view.points[..., 1] > 0, 0, view.masks)
    nothing = replace(view, tsdf=np.full_like(view.tsdf, 0.1), instances=0 * view.instances)
    return replace(nothing, masks=masks, eye=camera.T_world_camera[:3, 3])


def test_half_axes_are_told_along_other_axes():
    turn = equal_descriptions()[7].double().numpy()
    tilted = np.linalg.qr(np.eye(3) + 0.05 * np.random.default_rng(0).normal(size=(3, 3)))[0]
    tilted *= np.sign(np.diag(tilted))
    found = along(turn, tilted, np.array([1.0, 2.0, 3.0]))
    assert np.allclose(found, np.abs(turn).T @ [1.0, 2.0, 3.0])


def boxes_that_end_at(view, back):
    """The two boxes of the view, but so deep that their backs are there."""
    told = []
    for box in STACK:
        lower, upper = np.array(box.lower), np.array(box.upper)
        upper[1] = back
        ahead = np.abs(turn_of(view) @ (upper - lower) / 2)
        told.append([_in_view_frame(view, (lower + upper) / 2), ahead.tolist()])
    return told


def back_of(one):
    """How far a superquadric goes in the direction of y."""
    corners = shape_of(one).mesh(8).vertices @ one.pose.rotation.T + one.pose.position
    return corners[:, 1].max()


def test_objects_end_where_they_are_drawn_to_end():
    """Their backs are not seen; fronts and tops are, and stay there."""
    view = seen()
    for back in (0.03, 0.08, 0.13):
        boxes = [boxes_that_end_at(view, back)]
        best, drawn = method(boxes).superquadrics(view, 2, np.random.default_rng(0))
        for found in (best, drawn):
            assert set(found) == {1, 2}
            assert np.allclose([back_of(found[k]) for k in (1, 2)], back, atol=0.012)
            for k in (1, 2):
                points = view.points[view.masks == k]
                assert np.abs(signed_distance(found[k], points)).mean() < 0.003


def test_the_first_sample_is_in_the_middle_of_draws():
    view = seen()
    boxes = [boxes_that_end_at(view, back) for back in (0.03, 0.08, 0.09, 0.02, 0.12)]
    first, *draws = method(boxes, votes=3).superquadrics(view, 3, np.random.default_rng(0))
    assert np.allclose([back_of(first[k]) for k in (1, 2)], 0.08, atol=0.012)
    backs = [back_of(draw[1]) for draw in draws]
    assert np.allclose(backs, [0.02, 0.12], atol=0.012)  # draws of their own


def test_networks_are_shown_as_much_of_objects_as_in_their_training():
    view = seen()
    drawn = method([boxes_that_end_at(view, 0.08)])
    drawn.superquadrics(view, 1)
    assert drawn.model.shown.points.shape[-2:] == (192, 3)
    assert drawn.model.shown.ends.shape[-2:] == (48, 7)
    drawn.metadata |= ObjectSamples(points=40, ends=9, width=40).facts()
    drawn.superquadrics(view, 1)
    assert drawn.model.shown.points.shape[-2:] == (40, 3)
    assert drawn.model.shown.ends.shape[-2:] == (9, 7)


def test_without_votes_the_first_sample_is_the_fit_without_a_network():
    view = seen()
    found = [
        method([boxes_that_end_at(view, back)] * 2, votes=0).superquadrics(
            view, 3, np.random.default_rng(0)
        )
        for back in (0.03, 0.12)
    ]
    for k in (1, 2):
        assert np.array_equal(found[0][0][k].half_axes, found[1][0][k].half_axes)
        assert back_of(found[0][1][k]) < back_of(found[1][1][k]) - 0.03


def test_sets_of_all_rows_are_where_they_are_in_the_world():
    """Each row of a view has other points, so another frame; objects come back from all of them."""
    view = seen()
    fitted = [
        FittedSuperquadric(
            np.array([0.02, 0.03, 0.05]), np.array([2.0, 4.0, 8.0]), one.pose, 0.0, np.empty(0)
        )
        for one in method([boxes_that_end_at(view, 0.08)]).superquadrics(view, 1)[0].values()
    ]
    objects = SeenObjects(view, [1, 2], fitted, np.random.default_rng(0), rows=3)
    batch = objects.batch(fitted, torch.device("cpu"))
    assert batch.points.shape[0] == 3
    assert not torch.allclose(batch.positions[0], batch.positions[1], atol=1e-5)
    again = replace(batch, **{n: torch.cat([x, x[:1]]) for n, x in vars(batch).items()})
    world = objects.in_world(again)
    for row in range(4):
        for one, true in zip(world.objects(row), fitted, strict=True):
            assert np.allclose(one.pose.matrix, true.pose.matrix, atol=1e-5)
    middles = world.middle(slice(4), fitted)
    for one, true in zip(middles, fitted, strict=True):
        assert np.allclose(one.half_axes, true.half_axes, atol=1e-5)
        assert np.allclose(one.exponents, true.exponents, rtol=1e-4)


def test_a_view_of_nothing_is_an_empty_set():
    view = seen()
    network = registry.build("model", "set_extents")  # not told: it has to see the objects
    flow = DrawnSets(
        Inner(),
        JointFit(SuperquadricFit()),
        EvidenceOfView(),
        Loaded(network.requires_grad_(False)),
    )
    assert flow.superquadrics(replace(view, masks=0 * view.masks), 3) == [{}, {}, {}]


def test_what_is_drawn_where_something_else_is_seen_gives_way():
    """A draw in front of what is seen moves no face that is seen."""
    view = seen()
    boxes = [boxes_that_end_at(view, 0.08)]
    boxes[0][0] = [(np.array(boxes[0][0][0]) + [0, 0, 0.03]).tolist(), boxes[0][0][1]]
    best = method(boxes).superquadrics(view, 1, np.random.default_rng(0))[0]
    points = view.points[view.masks == 1]
    assert np.abs(signed_distance(best[1], points)).mean() < 0.003


def wider(told, view, label, by):
    """The same boxes, of which one goes further to its right by so much (m)."""
    ahead = turn_of(view)[:, 0]
    changed = [[list(part) for part in one] for one in told]
    centre, half = (np.array(part) for part in changed[label - 1])
    changed[label - 1] = [
        (centre + ahead * by / 2).tolist(),
        (half + np.abs(ahead) * by / 2).tolist(),
    ]
    return changed


@pytest.mark.parametrize("by", [0.15, 0.25])
def test_a_draw_through_seen_free_space_gives_way_to_the_fit(by):
    """No face decides how far the end goes, but what is beside the boxes is seen to be free."""
    view = seen()
    view = replace(view, free=np.abs(view.grid.centres()[..., 0]) > 0.12)
    told = boxes_that_end_at(view, 0.08)
    found = method([wider(told, view, 2, by)]).superquadrics(view, 2, np.random.default_rng(0))
    for scene in found:
        assert set(scene) == {1, 2}
        for one in scene.values():
            assert seen_through(places_in(one), surely_free(view)) <= 0.05


class Sinking(JointFit):
    """Fits that end 8 mm below the floor, as noise of thin objects lets them."""

    def together(self, evidence, start):
        return [
            replace(
                one,
                half_axes=one.half_axes + np.abs(one.pose.rotation[2]) * 0.004,
                pose=Pose(one.pose.position - np.array([0, 0, 0.004]), one.pose.quaternion),
            )
            for one in super().together(evidence, start)
        ]


def test_no_object_ends_below_the_floor_after_the_last_fit():
    view = seen()
    sinking = DrawnSets(
        Inner(),
        Sinking(SuperquadricFit()),
        EvidenceOfView(),
        Loaded(Told([boxes_that_end_at(view, 0.08)])),
    )
    lower = sinking.superquadrics(view, 1, np.random.default_rng(0))[0][1]
    corners = shape_of(lower).mesh(8).vertices @ lower.pose.rotation.T + lower.pose.position
    assert abs(corners[:, 2].min()) < 0.002
    points = view.points[view.masks == 1]
    assert np.abs(signed_distance(lower, points)).mean() < 0.003


def test_settings_out_of_range_are_told():
    for settings in ({"steps": 0}, {"votes": -1}, {"drawn_sigma": 0.001}, {"beyond": -0.1}):
        with pytest.raises(ConfigError, match=f"^{next(iter(settings))} = "):
            method([[]], **settings)


def with_hidden(view, *places):
    """Draws beside the best scene: one small box at each place, in one try after the other."""
    small = [0.01, 0.01, 0.01]
    told = boxes_that_end_at(view, 0.06)
    tries = [[*told, [_in_view_frame(view, np.array(place)), small]] for place in places]
    model = Told(tries)
    hidden = HiddenObjects(Loaded(model), tries=len(tries))
    best, drawn = method([told], hidden=hidden).superquadrics(view, 2, np.random.default_rng(0))
    return best, [one for label, one in drawn.items() if label not in best], model.known


def test_hidden_objects_appear_where_nothing_is_seen_alone():
    view = seen()
    behind = view.eye + 1.25 * (view.points[view.masks == 1].mean(axis=0) - view.eye)
    behind[2] = 0.02
    assert not view.free[tuple(np.rint(view.grid.to_voxels(behind)).astype(int))]
    in_the_air, outside = (0.0, -0.3, 0.5), (0.0, 0.9, 0.02)
    best, hidden, known = with_hidden(view, in_the_air, outside, behind)
    assert np.allclose([one.pose.position for one in hidden], [behind], atol=0.005)
    assert np.allclose(known.half_axes[0].numpy(), [best[k].half_axes for k in (1, 2)], atol=0.02)
    assert not with_hidden(view, in_the_air, outside)[1]
    inside = best[1].pose.position
    assert not with_hidden(view, inside)[1]


def test_where_there_is_no_room_for_two_hidden_objects_there_is_one():
    view = seen()
    behind = view.eye + 1.25 * (view.points[view.masks == 1].mean(axis=0) - view.eye)
    behind[2] = 0.02
    small, told = [0.01, 0.01, 0.01], boxes_that_end_at(view, 0.06)
    places = [_in_view_frame(view, np.array(place)) for place in (behind, (0.0, -0.3, 0.5))]
    model = Told([[*told, *[[place, small] for place in places]]])
    for model.hidden, count in ((2, 1), (0, 0)):
        hidden = HiddenObjects(Loaded(model), tries=2)
        best, drawn = method([told], hidden=hidden).superquadrics(view, 2, np.random.default_rng(0))
        assert len(drawn) - len(best) == count


def test_networks_that_draw_nothing_hidden_are_refused():
    model = Told([])
    model.draws_hidden = False
    with pytest.raises(ConfigError, match=r"checkpoints\.scenes=FILE"):
        HiddenObjects(Loaded(model))
    with pytest.raises(ConfigError, match="tries 0"):
        HiddenObjects(Loaded(Told([])), tries=0)


def _in_view_frame(view, place):
    """What a network must say for an object to be at a place of the world."""
    middle = np.mean([view.points[view.masks == k].mean(axis=0) for k in (1, 2)], axis=0)
    origin = np.array([middle[0], middle[1], 0.0])
    return (turn_of(view) @ (place - origin)).astype(np.float32).tolist()


def turn_of(view):
    """Rotation from the world to the frame of the view."""
    middle = np.mean([view.points[view.masks == k].mean(axis=0) for k in (1, 2)], axis=0)
    ahead = (middle - view.eye)[:2] / np.linalg.norm((middle - view.eye)[:2])
    return np.array([[*ahead, 0], [-ahead[1], ahead[0], 0], [0, 0, 1]])


def test_a_view_without_a_camera_is_told():
    view = replace(seen(), eye=None)
    boxes = boxes_that_end_at(seen(), 0.1)
    with pytest.raises(InputError, match="what one camera sees, and this view has no camera"):
        method(boxes).superquadrics(view, 1, np.random.default_rng(0))
