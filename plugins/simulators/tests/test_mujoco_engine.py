"""The MuJoCo engine: contacts, rest, the same ends as PyBullet's, independence of the past."""

import pickle
import sys

import numpy as np
import pytest

from scenefw.core.errors import MissingDependencyError
from scenefw.core.types import Pose, Scene, SceneObject
from scenefw.shapes.superquadric import Superquadric
from scenefw_simulators.engines.mujoco_engine import MujocoEngine

pytest.importorskip("mujoco", reason="needs mujoco (pip install 'scenefw[mujoco]')")


def thing(
    position, exponents=(100, 100, 100), half_axes=(0.05, 0.05, 0.05), quaternion=(1, 0, 0, 0)
):
    shape = Superquadric(half_axes, exponents)
    quaternion = np.array(quaternion, float) / np.linalg.norm(quaternion)
    return SceneObject(shape, Pose(np.array(position, float), quaternion), 500 * shape.volume())


@pytest.fixture
def engine():
    return MujocoEngine()


def test_boxes_rest_where_they_touch(engine):
    engine.reset()
    lower = engine.add(thing([0, 0, 0.06]))
    upper = engine.add(thing([0.01, 0, 0.17]))
    assert engine.settle(1000)
    assert engine.pose(lower).position[2] == pytest.approx(0.05, abs=2e-4)
    assert engine.pose(upper).position[2] == pytest.approx(0.15, abs=4e-4)
    assert engine.penetration() < 2e-4


def test_a_ball_falls_as_far_as_gravity_takes_it_and_rests_on_its_radius(engine):
    engine.reset()
    handle = engine.add(thing([0, 0, 1.3], (2, 2, 2)))
    engine.simulate(96)
    assert engine.pose(handle).position[2] == pytest.approx(1.3 - 9.81 / 2 * 0.4**2, abs=0.01)
    assert not engine.settle(8)
    assert engine.settle(2000)
    assert engine.pose(handle).position[2] == pytest.approx(0.05, abs=5e-4)


def test_overlaps_and_removal(engine):
    engine.reset()
    first = engine.add(thing([0, 0, 0.06]))
    assert engine.overlaps(engine.add(thing([0.08, 0, 0.06])))
    assert engine.overlaps(engine.add(thing([0.5, 0, 0.045])))
    assert not engine.overlaps(engine.add(thing([-0.2, 0, 0.3])))
    engine.remove(first)
    assert not engine.overlaps(engine.add(thing([-0.05, 0, 0.06])))


def test_what_falls_keeps_falling_when_another_object_comes(engine):
    engine.reset()
    alone = engine.add(thing([0, 0, 10]))
    engine.simulate(120)
    engine.add(thing([1, 0, 0.06]))
    engine.simulate(120)
    assert engine.pose(alone).position[2] == pytest.approx(10 - 9.81 / 2, abs=0.05)


def test_result_does_not_depend_on_the_past():
    def drop(engine):
        engine.reset()
        handles = [engine.add(thing([0.01 * i, 0, 0.2 + 0.15 * i], (3, 7, 20))) for i in range(2)]
        engine.simulate(200)
        return np.array([engine.pose(h).matrix for h in handles])

    used, fresh = MujocoEngine(), MujocoEngine()
    used.reset()
    used.add(thing([0, 0.1, 0.3], (2, 2, 9)))
    used.simulate(50)
    np.testing.assert_array_equal(drop(used), drop(fresh))
    np.testing.assert_array_equal(drop(used), drop(pickle.loads(pickle.dumps(used))))


def test_stacks_made_with_pybullet_stand_here_too(engine):
    from scenefw.data.batches.stacks import shipped_scenes
    from scenefw.scenes.storage import load_scenes

    stored = load_scenes(shipped_scenes())
    moved = [moves(engine, stored.scene(row)) for row in range(3)]
    assert max(np.concatenate(moved)) < 0.004  # m in a second


def moves(engine, scene: Scene):
    engine.reset()
    handles = [engine.add(item) for item in scene.objects]
    engine.simulate(240)
    ends = [engine.pose(handle).position for handle in handles]
    starts = [item.pose.position for item in scene.objects]
    return np.linalg.norm(np.array(ends) - starts, axis=1)


def test_missing_mujoco_names_the_install_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'scenefw\[mujoco\]'"):
        MujocoEngine().reset()
