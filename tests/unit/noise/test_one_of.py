"""Noise of one of several sensors."""

import pytest
import torch
from tests.composed import base
from tests.unit.kernels import analytic

from scenefw.core.errors import ConfigError
from scenefw.kernels.cameras import stack_cameras
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.one_of import OneOf


class Added:
    """Adds a depth, so that one sees whose noise an image got."""

    def __init__(self, metres):
        self.metres = metres

    def apply(self, depth, cameras, seeds):
        assert len(depth) == len(cameras.intrinsics) == len(seeds)
        return depth + self.metres


def applied(noise, depth, first=0):
    seeds = torch.arange(first, first + len(depth))
    return noise.apply(depth, stack_cameras([analytic.camera()] * len(depth)), seeds)


def test_each_sensor_gets_as_many_images_and_the_rest_pass():
    noise = OneOf({"near": Added(1.0), "far": Added(2.0)}, share=0.6)
    depth = torch.ones(3000, 2, 3)
    changes = (applied(noise, depth) - depth).flatten(1)
    assert (changes == changes[:, :1]).all()
    counts = [(changes[:, 0] == metres).float().mean() for metres in (0, 1, 2)]
    assert counts == pytest.approx([0.4, 0.3, 0.3], abs=0.04)


def test_a_sensor_is_drawn_as_often_as_its_weight_says():
    noise = OneOf({"near": Added(1.0), "far": Added(2.0)}, share=0.8, weights={"far": 3.0})
    depth = torch.ones(3000, 2, 3)
    changes = (applied(noise, depth) - depth)[:, 0, 0]
    counts = [(changes == metres).float().mean() for metres in (0, 1, 2)]
    assert counts == pytest.approx([0.2, 0.2, 0.6], abs=0.04)


def test_an_image_depends_on_its_seed_alone():
    noise = OneOf({"a": Gaussian(sigma=0.01), "b": Added(1.0)}, share=0.8)
    depth = torch.ones(40, 6, 8)
    alone = torch.cat([applied(noise, depth[i : i + 1], i) for i in range(40)])
    torch.testing.assert_close(applied(noise, depth), alone, rtol=0, atol=1e-6)


def test_no_sensor_and_numbers_out_of_range_are_refused():
    with pytest.raises(ConfigError, match="no sensors"):
        OneOf({}, share=0.5)
    with pytest.raises(ConfigError, match="share"):
        OneOf({"a": Added(1.0)}, share=1.5)
    with pytest.raises(ConfigError, match=r"weights = \['b'\]: expected names of a"):
        OneOf({"a": Added(1.0)}, share=0.5, weights={"b": 1.0})
    with pytest.raises(ConfigError, match=r"weights\.a = 0"):
        OneOf({"a": Added(1.0)}, share=0.5, weights={"a": 0.0})


def test_training_on_small_images_meets_four_kinds_of_sensors():
    noise = base("experiment=object_shells").dataset.noise.sensors
    assert base("experiment=part_images").dataset["views"].noise.sensors.sensors == noise.sensors
    assert set(noise.sensors) == {"kinect", "stereo", "time_of_flight", "phone_lidar"}
    assert all(sensor.share == 1.0 for sensor in noise.sensors.values())
