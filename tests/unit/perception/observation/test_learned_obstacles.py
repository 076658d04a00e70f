"""Obstacles by a network that takes all that is high for one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.errors import ConfigError
from scenefw.core.types import Camera
from scenefw.perception.observation.learned_obstacles import LearnedObstacles
from scenefw.perception.observation.pixel_probabilities import pixel_probabilities
from scenefw.perception.observation.points import world_points

WALL = Box((-2.0, 0.5, 0.0), (2.0, 0.6, 1.5))
HIGH = 0.3  # m


class HeightRule(torch.nn.Module):
    """Logits that say an obstacle above 0.3 m, an object below, and that all belongs together."""

    shown = obstacles = torch.nn.Identity()

    def __init__(self, focal):
        super().__init__()
        self.focal, self.weight, self.colour = focal, torch.nn.Parameter(torch.zeros(1)), None

    def forward(self, depth, cameras, colour=None):
        fx, fy, cx, cy = cameras.intrinsics[0].double().numpy()
        pose = cameras.T_world_camera[0].double().numpy()
        frame = SimpleNamespace(
            depth=depth[0].numpy(),
            camera=Camera(cameras.width, cameras.height, fx, fy, cx, cy, pose),
        )
        high = torch.from_numpy(world_points(frame)[..., 2] > HIGH).float() * 8 - 4
        self.colour = colour
        return torch.stack([torch.full_like(high, 4.0), torch.full_like(high, 5.0), -high, high])[
            None
        ]


def posed(boxes, size, **options):
    camera = camera_at(eye=(0.0, -1.4, 0.6), size=size)
    return replace(frame_of(camera, boxes, noise=0.001), camera=camera, **options)


def obstacles_of(frame, focal, min_pixels=60):
    points = world_points(frame)
    raised, floor = points[..., 2] > 0.015, np.abs(points[..., 2]) < 0.015
    finder = LearnedObstacles(SimpleNamespace(model=HeightRule(focal)), min_pixels)
    return finder.find(frame, points, raised, floor), raised


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
@pytest.mark.parametrize("thinning", [1, 2])
def test_what_the_network_says_is_an_obstacle(size, thinning):
    frame = posed((*STACK, WALL), size)
    (region,), raised = obstacles_of(frame, frame.camera.fx / thinning)
    high = raised & (world_points(frame)[..., 2] > HIGH)
    assert not region.pixels[raised & (frame.labels != len(STACK) + 1)].any()
    # borders are as exact as the thinned image
    assert (region.pixels & high).sum() > 0.97 * high.sum()
    assert (region.pixels & ~high).sum() < 0.03 * high.sum()


def test_without_any_there_are_none():
    frame = posed(STACK, (320, 240))
    assert obstacles_of(frame, frame.camera.fx)[0] == []


def test_few_pixels_are_none():
    frame = posed((Box((0.0, 0.0, 0.0), (0.01, 0.01, 0.31)),), (320, 240))
    assert obstacles_of(frame, frame.camera.fx)[0] == []
    assert obstacles_of(frame, frame.camera.fx, min_pixels=1)[0]


def test_probabilities_are_of_neighbours_and_see_the_colour():
    frame = posed(STACK, (320, 240), colour=np.full((240, 320, 3), 51, np.uint8))
    network = HeightRule(frame.camera.fx / 2)
    probabilities = pixel_probabilities(network, frame)
    assert probabilities.step == 2
    assert probabilities.across.shape == (120, 159)
    assert probabilities.down.shape == (119, 160)
    np.testing.assert_allclose(probabilities.across, 1 / (1 + np.exp(-4)), rtol=1e-6)
    np.testing.assert_allclose(probabilities.down, 1 / (1 + np.exp(-5)), rtol=1e-6)
    np.testing.assert_allclose(probabilities.objects, 1 - probabilities.obstacles, atol=1e-6)
    assert network.colour.shape == (1, 3, 120, 160)
    assert float(network.colour.max()) == pytest.approx(0.2)


def test_weights_without_obstacles_are_refused():
    network = HeightRule(300.0)
    network.obstacles = None
    with pytest.raises(ConfigError, match="part_images"):
        LearnedObstacles(SimpleNamespace(model=network), 60)
