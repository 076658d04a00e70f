"""Penetration depth against cases known in closed form."""

import numpy as np
import pytest

from scenefw.core.geometry import random_quaternion
from scenefw.core.types import Pose, Scene, SceneObject
from scenefw.shapes.superquadric import Superquadric
from scenefw_publishing.scene_checks import deepest_penetration


def thing(position, exponents, half_axes, quaternion=(1.0, 0, 0, 0)):
    pose = Pose(np.array(position, float), np.array(quaternion))
    return SceneObject(Superquadric(half_axes, exponents), pose, 1.0)


@pytest.mark.parametrize("depth", [-0.01, 0.0, 0.002, 0.02])
def test_balls(depth):
    rng = np.random.default_rng(0)
    direction = rng.normal(size=3)
    direction *= (0.15 - depth) / np.linalg.norm(direction)
    high = np.array([0, 0, 1.0])
    scene = Scene(
        (
            thing(high, [2, 2, 2], [0.1] * 3, random_quaternion(rng)),
            thing(high + direction, [2, 2, 2], [0.05] * 3, random_quaternion(rng)),
        )
    )
    assert deepest_penetration(scene) == pytest.approx(depth, abs=2e-5)


@pytest.mark.parametrize("depth", [-0.01, 0.001, 0.01])
def test_stacked_boxes(depth):
    boxes = [thing([0, 0, z], [100, 100, 100], [0.1, 0.1, 0.05]) for z in (0.06, 0.16 - depth)]
    assert deepest_penetration(Scene(tuple(boxes))) == pytest.approx(depth, abs=1e-5)


def test_floor():
    scene = Scene((thing([0, 0, 0.097], [2, 2, 2], [0.05, 0.05, 0.1]),))
    assert deepest_penetration(scene) == pytest.approx(0.003, abs=1e-9)


def test_other_shapes_are_refused():
    class Lump:
        pass

    item = SceneObject(Lump(), Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), 1.0)
    with pytest.raises(TypeError, match="Lump"):
        deepest_penetration(Scene((item,)))
