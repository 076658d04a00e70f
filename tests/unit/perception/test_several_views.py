"""Methods on several views: joined parts, fits to all views, codes that explain them."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from tests.unit.mapping.test_several_views import BACK, FRONT, GRID, box_at, seen
from torch import nn

from scenefw.core.batches import Completion, ShapeInstancePrediction
from scenefw.core.errors import ConfigError
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.metrics.occupancy import occupancy_iou
from scenefw.perception.conditioned import Conditioned
from scenefw.perception.evidence import EvidenceOfView
from scenefw.perception.fitted import Fitted
from scenefw.perception.fitted_to_views import FittedToViews
from scenefw.perception.optimised_code import OptimisedCode
from scenefw.perception.parts_of_views import PartsOfViews
from scenefw.perception.points import world_points
from scenefw.perception.reconstruction import NetworkReconstructor
from scenefw.perception.seen_frames import seen_frames
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
    joined = PartsOfViews(parts)
    (scene,) = joined.complete(views, GRID, 1, NOISE)
    assert scene.instances.unique().tolist() == [0, 1]
    assert scene.masks.shape == (1, 120, 80)
    joined.complete(views[:1], GRID, 1, NOISE)
    assert parts.calls == 2  # each view once
    fitted = Fitted(parts, SuperquadricFit(), EvidenceOfView())
    (sharp,) = FittedToViews(joined, fitted).complete(views, GRID, 1, NOISE)
    truth = scene_volumes(box_at(0.0), GRID).tsdf[0, 0].numpy() < 0
    assert occupancy_iou(sharp.tsdf[0].numpy() < 0, truth) > 0.9
    assert occupancy_iou(scene.tsdf[0].numpy() < 0, truth) < 0.8


def test_objects_that_share_too_little_stay_two():
    views = seen(box_at(0.0), FRONT, BACK)
    (scene,) = PartsOfViews(HalfSeen(), shared=0.9).complete(views, GRID, 1, NOISE)
    assert scene.instances.unique().tolist() == [0, 1, 2]


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
        PartsOfViews(HalfSeen(), shared=0)
