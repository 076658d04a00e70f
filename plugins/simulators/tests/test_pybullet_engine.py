"""The PyBullet engine: contacts without gaps, rest, independence of what was simulated before."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

from scenefw.core.errors import MissingDependencyError
from scenefw.core.types import Pose, SceneObject
from scenefw.shapes.superquadric import Superquadric
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine

pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")


def thing(
    position, exponents=(100, 100, 100), half_axes=(0.05, 0.05, 0.05), quaternion=(1, 0, 0, 0)
):
    shape = Superquadric(half_axes, exponents)
    quaternion = np.array(quaternion, float) / np.linalg.norm(quaternion)
    return SceneObject(shape, Pose(np.array(position, float), quaternion), 500 * shape.volume())


@pytest.fixture
def engine():
    engine = PyBulletEngine()
    yield engine
    engine.close()


def test_boxes_rest_where_they_touch(engine):
    engine.reset()
    lower = engine.add(thing([0, 0, 0.06]))
    upper = engine.add(thing([0.01, 0, 0.17]))
    assert engine.settle(1000)
    assert engine.pose(lower).position[2] == pytest.approx(0.05, abs=2e-4)
    assert engine.pose(upper).position[2] == pytest.approx(0.15, abs=4e-4)
    assert engine.penetration() < 2e-4


def test_an_ellipsoid_falls_onto_its_flat_side(engine):
    engine.reset()
    handle = engine.add(thing([0, 0, 0.2], (2, 2, 2), (0.1, 0.1, 0.03), (1, 0.7, 0, 0)))
    assert engine.settle(3000)
    pose = engine.pose(handle)
    assert abs(pose.rotation[2, 2]) > 0.998  # within 4 degrees: it is a polyhedron
    assert pose.position[2] == pytest.approx(0.03, abs=1e-3)


def test_falling_follows_gravity(engine):
    engine.reset()
    handle = engine.add(thing([0, 0, 10]))
    engine.simulate(240)
    assert engine.pose(handle).position[2] == pytest.approx(10 - 9.81 / 2, abs=0.15)
    assert not engine.settle(24)


def test_overlaps(engine):
    engine.reset()
    engine.add(thing([0, 0, 0.06]))
    assert engine.overlaps(engine.add(thing([0.08, 0, 0.06])))
    assert engine.overlaps(engine.add(thing([0.5, 0, 0.045])))
    assert not engine.overlaps(engine.add(thing([-0.2, 0, 0.3])))


def test_removed_objects_are_gone(engine):
    engine.reset()
    engine.remove(engine.add(thing([0, 0, 0.1])))
    assert not engine.overlaps(engine.add(thing([0, 0, 0.1])))


def test_result_does_not_depend_on_the_past():
    def drop(engine):
        engine.reset()
        handles = [engine.add(thing([0.01 * i, 0, 0.2 + 0.15 * i], (3, 7, 20))) for i in range(3)]
        engine.simulate(400)
        return np.array([engine.pose(h).matrix for h in handles])

    used, fresh = PyBulletEngine(), PyBulletEngine()
    used.reset()
    used.add(thing([0, 0.1, 0.3], (2, 2, 9)))
    used.simulate(100)
    np.testing.assert_array_equal(drop(used), drop(fresh))
    np.testing.assert_array_equal(drop(used), drop(pickle.loads(pickle.dumps(fresh))))


def test_two_engines_do_not_share_a_world():
    one, two = PyBulletEngine(), PyBulletEngine()
    one.reset()
    two.reset()
    one.add(thing([0, 0, 0.1]))
    assert not two.overlaps(two.add(thing([0, 0, 0.1])))


def test_missing_pybullet_names_the_install_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'scenefw\[simulation\]'"):
        PyBulletEngine().reset()


def test_the_import_says_nothing():
    code = "from scenefw_simulators.engines.pybullet_engine import PyBulletEngine as E; E().reset()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
