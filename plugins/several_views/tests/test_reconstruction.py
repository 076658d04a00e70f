"""Codes and networks that see several views."""

from types import SimpleNamespace

import pytest
import torch
from tests.unit.mapping.test_several_views import BACK, FRONT, GRID, box_at, seen
from torch import nn

from scenefw.core.batches import ShapeInstancePrediction
from scenefw.core.errors import ConfigError
from scenefw.metrics.occupancy import occupancy_iou
from scenefw.perception.completion.volume_network import VolumeNetwork
from scenefw.representations.volumes import scene_volumes
from scenefw_several_views.conditioned import Conditioned
from scenefw_several_views.differentiable import Differentiable
from scenefw_several_views.optimised_code import OptimisedCode

NOISE = torch.Generator()


class BoxDecoder(nn.Module):
    """A network whose code says where the box stands along x, in decimetres."""

    latent_size, outputs = 1, {"tsdf": 1}

    def predict(self, condition, latent=None):
        x, y, z = (torch.tensor(GRID.centres()[..., k]).float() for k in range(3))
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
    return VolumeNetwork(checkpoint, NoInstances(), smoothing=0)


def test_the_code_moves_the_box_to_where_the_views_show_it():
    views = seen(box_at(0.06), FRONT, BACK)
    method = OptimisedCode(network(), Differentiable(stride=1), iterations=30, rate=0.1)
    code, costs = method.optimised(torch.zeros(1, 1), views[0], views, GRID)
    assert float(code) == pytest.approx(0.6, abs=0.08)
    assert costs[-1] < 0.4 * costs[0]
    assert len(costs) == 31
    (scene,) = method.complete_views(views, GRID, 1, NOISE)
    truth = scene_volumes(box_at(0.06), GRID).tsdf[0, 0].numpy() < 0
    assert occupancy_iou(scene.tsdf[0].numpy() < 0, truth) > 0.85


def test_conditioning_gives_the_inner_method_what_all_views_observe():
    views = seen(box_at(0.0), FRONT, BACK)

    class Counting:
        grid = GRID

        def complete(self, partial, grid, samples, generator):
            return [partial.observed.sum()] * samples

    (count,) = Conditioned(Counting()).complete_views(views, GRID, 1, NOISE)
    assert count == (views[0].observed | views[1].observed).sum()


def test_numbers_are_checked():
    with pytest.raises(ConfigError, match="iterations"):
        OptimisedCode(network(), Differentiable(), iterations=0)
