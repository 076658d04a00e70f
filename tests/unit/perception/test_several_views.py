"""Methods on several views: joined parts, fits to all views, codes that explain them."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scenefw.perception.observation.view_frames import seen_frames
from tests.unit.mapping.test_several_views import BACK, FRONT, GRID, box_at, seen
from torch import nn

from scenefw.core.batches import Completion, SceneParameters, ShapeInstancePrediction
from scenefw.core.errors import ConfigError
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.metrics.occupancy import occupancy_iou
from scenefw.perception.completion.superquadrics import Fitted
from scenefw.perception.completion.volume_network import NetworkReconstructor
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.grouping.merging import FitMerging
from scenefw.perception.grouping.reassignment import ResidualReassignment
from scenefw.perception.multiview.conditioned import Conditioned
from scenefw.perception.multiview.fitted_to_views import ViewsFit
from scenefw.perception.multiview.optimised_code import OptimisedCode
from scenefw.perception.multiview.parts_of_views import ViewsGrouping, _refined
from scenefw.perception.observation.points import world_points
from scenefw.renderers.differentiable import Differentiable
from scenefw.representations.volumes import scene_volumes

NOISE = torch.Generator()


class HalfSeen:
    """Finds in each view the half of the box that is nearer to the camera, and says its pixels."""

    grid, metadata = GRID, {}

    def __init__(self):
        self.calls = 0

    def complete(self, partial, grid, samples, generator):
        self.calls += 1
        volumes = scene_volumes(box_at(0.0), grid)
        side = float(partial.cameras.T_world_camera[0, 0, 3])
        near = torch.from_numpy(grid.centres()[..., 0] * np.sign(side) > -0.03)
        labels = torch.where(near, volumes.instances[0], 0).int()
        (frame,) = seen_frames(partial, "a test")
        shown = torch.from_numpy(world_points(frame)[..., 2] > 0.01)[None]  # not the floor
        return [Completion(volumes.tsdf[:, 0], labels[None], masks=shown.int())]


class MasksOf:
    """Finds the boxes of a scene by which of them a seen point is nearest to.

    In views from `blind` (a place along y) all are one.
    """

    grid, metadata = GRID, {}

    def __init__(self, scene, blind=None):
        self.scene, self.blind = scene, blind

    def complete(self, partial, grid, samples, generator):
        volumes = scene_volumes(self.scene, grid)
        (frame,) = seen_frames(partial, "a test")
        points = world_points(frame)
        away = np.linalg.norm(points[..., None, :] - self.scene.positions[0].numpy(), axis=-1)
        shown = np.where(points[..., 2] > 0.01, away.argmin(axis=-1) + 1, 0)
        labels = volumes.instances
        if self.blind is not None and partial.cameras.T_world_camera[0, 1, 3] * self.blind > 0:
            shown, labels = (shown > 0).astype(int), (labels > 0).int()
        masks = torch.from_numpy(shown.astype(np.int32))[None]
        return [Completion(volumes.tsdf[:, 0], labels, masks=masks)]


def two_boxes():
    """A tall box and a flat one side by side along x."""
    one, half_axes = box_at(0.0), torch.tensor([[[0.08, 0.08, 0.12], [0.1, 0.08, 0.04]]])
    places = torch.tensor([[[-0.12, 0.0, 0.12], [0.12, 0.0, 0.04]]])
    return SceneParameters(
        half_axes, one.exponents.expand(1, 2, 3) * 3, one.rotations.expand(1, 2, 3, 3), places,
        one.present.expand(1, 2),
    )  # fmt: skip


def by_evidence():
    return FitMerging(SuperquadricFit(), EvidenceGathering(hidden_points=1))


def dealt():
    return ResidualReassignment(
        by_evidence(), SuperquadricFit(), EvidenceGathering(hidden_points=1)
    )


class BoxDecoder(nn.Module):
    """A network whose code says where the box stands along x, in decimetres."""

    latent_size, outputs = 1, {"tsdf": 1}

    def predict(self, condition, latent=None):
        x, y, z = (torch.from_numpy(GRID.centres()[..., k]).float() for k in range(3))
        away = torch.stack([(x - 0.1 * latent[0, 0]).abs(), y.abs(), (z - 0.1).abs()]) - 0.1
        outside = away.clamp(min=0).norm(dim=0) + away.amax(dim=0).clamp(max=0)
        tsdf = (outside / GRID.truncation).clamp(-1, 1)
        return ShapeInstancePrediction({"tsdf": tsdf[None, None]}, latent=latent)


class NoInstances:
    """All that is inside is one object."""

    def extract(self, tsdf, votes, grid):
        return (tsdf < 0).int(), torch.zeros(1, 3)


def network():
    checkpoint = SimpleNamespace(model=BoxDecoder(), grid=GRID, metadata={})
    return NetworkReconstructor(checkpoint, NoInstances(), smoothing=0)


def test_halves_seen_from_two_sides_are_one_object_and_fitted_whole():
    views, parts = seen(box_at(0.0), FRONT, BACK), HalfSeen()
    joined = ViewsGrouping(parts, dealt())
    (scene,) = joined.complete(views, GRID, 1, NOISE)
    assert scene.instances.unique().tolist() == [0, 1]
    assert scene.masks.shape == (1, 120, 80)
    joined.complete(views[:1], GRID, 1, NOISE)
    assert parts.calls == 2  # each view once
    fitted = Fitted(parts, SuperquadricFit(), EvidenceGathering())
    (sharp,) = ViewsFit(joined, fitted).complete(views, GRID, 1, NOISE)
    truth = scene_volumes(box_at(0.0), GRID).tsdf[0, 0].numpy() < 0
    assert occupancy_iou(sharp.tsdf[0].numpy() < 0, truth) > 0.9
    assert occupancy_iou(scene.tsdf[0].numpy() < 0, truth) > 0.9  # the hull of both halves


def test_boxes_side_by_side_stay_two():
    scene = two_boxes()
    views = seen(scene, (0.0, 0.9, 0.5), (0.0, -0.9, 0.5))
    (found,) = ViewsGrouping(MasksOf(scene), dealt()).complete(views, GRID, 1, NOISE)
    assert sorted(found.masks.unique().tolist()) == [0, 1, 2]
    first, second = np.split(found.masks[0].numpy(), 2)
    for shown, view in zip((first, second), views, strict=True):
        points = world_points(seen_frames(view, "a test")[0])
        left = shown[points[..., 0] < -0.03]
        right = shown[(points[..., 0] > 0.03) & (points[..., 2] > 0.01)]
        assert np.unique(left[left > 0]).tolist() != np.unique(right).tolist()
    assert np.bincount(found.instances[0].ravel())[1:].min() > 50


def test_a_view_that_takes_two_for_one_is_overruled_by_those_that_know_better():
    scene = two_boxes()
    eyes = (0.5, 0.7, 0.6), (-0.5, 0.7, 0.6), (0.0, 0.9, 0.3), (0.0, -0.8, 0.6)
    views, parts = seen(scene, *eyes), MasksOf(scene, blind=-1)
    (before,) = ViewsGrouping(parts, by_evidence()).complete(views, GRID, 1, NOISE)
    assert before.masks.max() > 2
    (found,) = ViewsGrouping(parts, dealt()).complete(views, GRID, 1, NOISE)
    assert found.masks.max() == 2
    last = np.split(found.masks[0].numpy(), len(eyes))[-1]
    points = world_points(seen_frames(views[-1], "a test")[0])
    high = points[..., 2] > 0.01
    sides = [np.bincount(last[high & (s * points[..., 0] > 0.03)], minlength=3) for s in (1, -1)]
    assert {int(one.argmax()) for one in sides} == {1, 2}
    assert all(one.max() > 0.95 * one.sum() for one in sides)


def test_objects_that_no_grouping_knows_keep_their_number():
    """Parts too small for the coarse image, and parts that were cut."""
    parts = np.zeros((8, 8), np.int32)
    parts[:, :4], parts[1, 7] = 1, 2
    few = parts[::2, ::2]
    cut = few.copy()
    cut[2:, :2] = 5
    found = _refined(cut, few, parts, 2)
    assert found[0, 0] == 1
    assert found[7, 3] == 5
    assert (found[:, :4] > 0).all()
    assert found[1, 7] not in (0, 1, 5)
    assert (found[:, 4:7] == 0).all()


def test_the_code_moves_the_box_to_where_the_views_show_it():
    views = seen(box_at(0.06), FRONT, BACK)
    method = OptimisedCode(network(), Differentiable(stride=1), iterations=30, rate=0.1)
    code, costs = method.optimised(torch.zeros(1, 1), views[0], views, GRID)
    assert float(code) == pytest.approx(0.6, abs=0.08)
    assert costs[-1] < 0.4 * costs[0]
    assert len(costs) == 31
    (scene,) = method.complete(views, GRID, 1, NOISE)
    truth = scene_volumes(box_at(0.06), GRID).tsdf[0, 0].numpy() < 0
    assert occupancy_iou(scene.tsdf[0].numpy() < 0, truth) > 0.85


def test_conditioning_gives_the_inner_method_what_all_views_observe():
    views = seen(box_at(0.0), FRONT, BACK)

    class Counting:
        grid = GRID

        def complete(self, partial, grid, samples, generator):
            return [partial.observed.sum()] * samples

    (count,) = Conditioned(Counting()).complete(views, GRID, 1, NOISE)
    assert count == (views[0].observed | views[1].observed).sum()


def test_numbers_are_checked():
    with pytest.raises(ConfigError, match="iterations"):
        OptimisedCode(network(), Differentiable(), iterations=0)
    with pytest.raises(ConfigError, match="share above 0"):
        ResidualReassignment(
            by_evidence(), SuperquadricFit(), EvidenceGathering(), min_explained_ratio=0
        )
