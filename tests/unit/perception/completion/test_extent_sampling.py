"""Samples of a network as what is expected of hidden parts, and as hidden objects."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import torch
from tests.unit.perception.completion.observed_boxes import FRONT
from tests.unit.perception.evidence.test_gathering import scene_of
from tests.unit.perception.synthetic import STACK
from tests.unit.perception.usual_fits import TOLERANCES, object_fit

from scenefw import registry
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.set_flows import SetFlowBatch
from scenefw.core.types import Pose
from scenefw.data.batches.view_samples import ObjectSamples
from scenefw.fitting.joint import JointFit
from scenefw.fitting.placed import shape_of, signed_distance
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.completion.extent_inputs import ExtentInputs, along
from scenefw.perception.completion.extent_sampling import ExtentSampling
from scenefw.perception.observation.free_space import free_ratio, places_in
from scenefw.perception.steps import Objects
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
        return SetFlowBatch(
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


FIT = JointFit(SuperquadricFit())
USUAL = {"steps": 20, "median_of": 32, "spread": 1.0, "pseudo_sigma": 0.008, "min_gap": 0.01}


def method(boxes, fit=FIT, **settings):
    """With a network that samples these boxes."""
    return ExtentSampling(fit, TOLERANCES, Loaded(Told(boxes)), **USUAL | settings)


def sampled(sampling, scene, samples=1):
    """The superquadrics of hypotheses, by label."""
    fits = object_fit().fit(*scene)
    sets = sampling.complete(fits, scene[1], samples, torch.Generator().manual_seed(0))
    return [each.superquadrics for each in sets]


def fronts():
    """The fronts of two boxes: their backs are hidden, and no rough volume says where."""
    objects, geometry = scene_of(48)
    masks = np.where(geometry.points[..., 1] > 0, 0, objects.masks)
    return Objects(masks), replace(geometry, eye=FRONT.T_world_camera[:3, 3])


def test_half_axes_are_told_along_other_axes():
    turn = equal_descriptions()[7].double().numpy()
    tilted = np.linalg.qr(np.eye(3) + 0.05 * np.random.default_rng(0).normal(size=(3, 3)))[0]
    tilted *= np.sign(np.diag(tilted))
    found = along(turn, tilted, np.array([1.0, 2.0, 3.0]))
    assert np.allclose(found, np.abs(turn).T @ [1.0, 2.0, 3.0])


def boxes_that_end_at(scene, back):
    """The two boxes of a scene, but so deep that their backs are there."""
    told = []
    for box in STACK:
        lower, upper = np.array(box.lower), np.array(box.upper)
        upper[1] = back
        ahead = np.abs(turn_of(scene) @ (upper - lower) / 2)
        told.append([_in_view_frame(scene, (lower + upper) / 2), ahead.tolist()])
    return told


def apart(one, label, scene):
    """Mean distance (m) of an object's visible points from a superquadric."""
    objects, view = scene
    return np.abs(signed_distance(one, view.points[objects.masks == label])).mean()


def back_of(one):
    """How far a superquadric goes in the direction of y."""
    corners = shape_of(one).mesh(8).vertices @ one.pose.rotation.T + one.pose.position
    return corners[:, 1].max()


def test_objects_end_where_they_are_drawn_to_end():
    """Their backs are not seen; fronts and tops are, and stay there."""
    scene = fronts()
    for back in (0.03, 0.08, 0.13):
        boxes = [boxes_that_end_at(scene, back)]
        for found in sampled(method(boxes), scene, 2):
            assert set(found) == {1, 2}
            assert np.allclose([back_of(found[k]) for k in (1, 2)], back, atol=0.012)
            for k in (1, 2):
                assert apart(found[k], k, scene) < 0.003


def test_the_first_hypothesis_is_the_median_of_samples():
    scene = fronts()
    boxes = [boxes_that_end_at(scene, back) for back in (0.03, 0.08, 0.09, 0.02, 0.12)]
    first, *further = sampled(method(boxes, median_of=3), scene, 3)
    assert np.allclose([back_of(first[k]) for k in (1, 2)], 0.08, atol=0.012)
    backs = [back_of(each[1]) for each in further]
    assert np.allclose(backs, [0.02, 0.12], atol=0.012)  # samples of their own


def test_networks_are_shown_as_much_of_objects_as_in_their_training():
    scene = fronts()
    sampling = method([boxes_that_end_at(scene, 0.08)])
    assert sampling.metadata == {"made": "by hand"}
    sampled(sampling, scene)
    assert sampling.model.shown.points.shape[-2:] == (192, 3)
    assert sampling.model.shown.ends.shape[-2:] == (48, 7)
    sampling.metadata |= ObjectSamples(points=40, ends=9, width=40).facts()
    sampled(sampling, scene)
    assert sampling.model.shown.points.shape[-2:] == (40, 3)
    assert sampling.model.shown.ends.shape[-2:] == (9, 7)


def test_the_median_of_no_sample_is_the_fit_without_a_network():
    scene = fronts()
    found = [
        sampled(method([boxes_that_end_at(scene, back)] * 2, median_of=0), scene, 3)
        for back in (0.03, 0.12)
    ]
    for k in (1, 2):
        assert np.array_equal(found[0][0][k].half_axes, found[1][0][k].half_axes)
        assert back_of(found[0][1][k]) < back_of(found[1][1][k]) - 0.03


def test_sets_of_all_rows_are_where_they_are_in_the_world():
    """Each row of a view has other points, so another frame; objects come back from all of them."""
    scene = fronts()
    fitted = [
        FittedSuperquadric(
            np.array([0.02, 0.03, 0.05]), np.array([2.0, 4.0, 8.0]), one.pose, 0.0, np.empty(0)
        )
        for one in sampled(method([boxes_that_end_at(scene, 0.08)]), scene)[0].values()
    ]
    objects, view = scene
    shown = ExtentInputs(
        view, objects.masks, [1, 2], fitted, np.random.default_rng(0), 0.006, rows=3
    )
    batch = shown.batch(fitted, torch.device("cpu"))
    assert batch.points.shape[0] == 3
    assert not torch.allclose(batch.positions[0], batch.positions[1], atol=1e-5)
    again = replace(batch, **{n: torch.cat([x, x[:1]]) for n, x in vars(batch).items()})
    world = shown.in_world(again)
    for row in range(4):
        for one, true in zip(world.objects(row), fitted, strict=True):
            assert np.allclose(one.pose.matrix, true.pose.matrix, atol=1e-5)
    middles = world.middle(slice(4), fitted)
    for one, true in zip(middles, fitted, strict=True):
        assert np.allclose(one.half_axes, true.half_axes, atol=1e-5)
        assert np.allclose(one.exponents, true.exponents, rtol=1e-4)


def test_a_view_of_nothing_is_an_empty_set():
    objects, view = fronts()
    network = registry.build("model", "set_extents")  # not told: it has to see the objects
    flow = ExtentSampling(FIT, TOLERANCES, Loaded(network.requires_grad_(False)), **USUAL)
    assert sampled(flow, (Objects(0 * objects.masks), view), 3) == [{}, {}, {}]


def test_a_sample_where_something_else_is_seen_gives_way():
    """A sample in front of what is seen moves no face that is seen."""
    scene = fronts()
    boxes = [boxes_that_end_at(scene, 0.08)]
    boxes[0][0] = [(np.array(boxes[0][0][0]) + [0, 0, 0.03]).tolist(), boxes[0][0][1]]
    (best,) = sampled(method(boxes), scene)
    assert apart(best[1], 1, scene) < 0.003


def wider(told, scene, label, by):
    """The same boxes, of which one goes further to its right by so much (m)."""
    ahead = turn_of(scene)[:, 0]
    changed = [[list(part) for part in one] for one in told]
    centre, half = (np.array(part) for part in changed[label - 1])
    changed[label - 1] = [
        (centre + ahead * by / 2).tolist(),
        (half + np.abs(ahead) * by / 2).tolist(),
    ]
    return changed


@pytest.mark.parametrize("by", [0.15, 0.25])
def test_a_sample_through_seen_free_space_gives_way_to_the_fit(by):
    """No face decides how far the end goes, but what is beside the boxes is seen to be free."""
    objects, view = fronts()
    view = replace(view, free=np.abs(view.grid.centres()[..., 0]) > 0.12)
    scene = objects, view
    told = boxes_that_end_at(scene, 0.08)
    for found in sampled(method([wider(told, scene, 2, by)]), scene, 2):
        assert set(found) == {1, 2}
        for one in found.values():
            assert free_ratio(places_in(one), view.clear, view.grid) <= 0.05


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
    scene = fronts()
    sinking = method([boxes_that_end_at(scene, 0.08)], fit=Sinking(SuperquadricFit()))
    lower = sampled(sinking, scene)[0][1]
    corners = shape_of(lower).mesh(8).vertices @ lower.pose.rotation.T + lower.pose.position
    assert abs(corners[:, 2].min()) < 0.002
    assert apart(lower, 1, scene) < 0.003


def test_settings_out_of_range_are_told():
    wrong = {"steps": 0, "median_of": -1, "spread": -1.0, "pseudo_sigma": 0.0, "min_gap": -0.1}
    for name, value in wrong.items():
        with pytest.raises(ConfigError, match=f"^{name} = "):
            method([[]], **{name: value})


def middle_of(scene):
    """The mean of what is visible of both boxes."""
    objects, view = scene
    return np.mean([view.points[objects.masks == k].mean(axis=0) for k in (1, 2)], axis=0)


def _in_view_frame(scene, place):
    """What a network must say for an object to be at a place of the world."""
    middle = middle_of(scene)
    origin = np.array([middle[0], middle[1], 0.0])
    return (turn_of(scene) @ (place - origin)).astype(np.float32).tolist()


def turn_of(scene):
    """Rotation from the world to the frame of the view."""
    way = (middle_of(scene) - scene[1].eye)[:2]
    ahead = way / np.linalg.norm(way)
    return np.array([[*ahead, 0], [-ahead[1], ahead[0], 0], [0, 0, 1]])


def test_a_view_without_a_camera_is_told():
    scene = fronts()
    blind = scene[0], replace(scene[1], eye=None)
    with pytest.raises(InputError, match="what one camera sees, and this view has no camera"):
        sampled(method([boxes_that_end_at(scene, 0.1)]), blind)
