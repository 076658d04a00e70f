"""Lifts and rankings in scenes whose outcome is plain."""

import itertools
import pickle

import numpy as np
import pytest
from plugins.grasping.tests.boxes import EYE, TOWER, box, grasping

from scenefw.core.errors import ConfigError
from scenefw.core.types import TriangleMesh
from scenefw_grasping.grasps import Grasp
from scenefw_grasping.lifting import LiftSimulation
from scenefw_grasping.panda import PandaArm
from scenefw_grasping.suction import SuctionCup, frame_along
from scenefw_simulators.engines.mujoco_engine import MujocoEngine

pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")

DOWN = np.array([0.0, 0, -1])


def from_above(label, point, turn=0.0):
    return Grasp(label, frame_along(DOWN, np.array(point), turn))


def lifted(objects, grasp, **options):
    found = grasping()
    (grasp,) = found.lifting.feasible(objects, [grasp], 1) or (grasp,)
    return found.lift(objects, grasp, **options)


def test_lifting_the_lid_disturbs_nothing():
    lift = lifted(TOWER, from_above(3, (0, 0, 0.16)), film=True)
    assert lift.failure == ""
    assert lift.label == 3
    assert set(lift.shifts) == {1, 2}
    assert lift.disturbance < 1e-3
    film = lift.film
    assert film.poses.shape[1:] == (len(film.meshes), 4, 4)
    assert film.labels[-3:] == (1, 2, 3)
    rise = film.poses[-1, -1, 2, 3] - film.poses[0, -1, 2, 3]
    assert rise == pytest.approx(0.15, abs=0.02)


def test_taking_a_support_away_drops_the_lid():
    side = Grasp(2, frame_along(np.array([0, 1.0, 0]), np.array([0, -0.14, 0.06])), outward=True)
    lift = lifted(TOWER, side)
    assert lift.label == 2
    assert lift.shifts[3] > 0.03
    assert lift.shifts[1] < lift.shifts[3]


@pytest.mark.parametrize(
    ("objects", "point", "failure", "label"),
    [
        ({1: box((0.1, 0.1, 0.1), (0.2, 0, 0.05))}, (0, 0, 0.1), "the cup meets nothing", 0),
        ({1: box([0.06] * 3, (0, 0, 0.03), exponent=2)}, (0, 0, 0.06), "the cup doesn't seal", 1),
        ({1: box([0.1] * 3, (0, 0, 0.05), 20.0)}, (0, 0, 0.1), "the object is too heavy", 1),
        ({1: box([0.1] * 3, (2, 0, 0.05))}, (2, 0, 0.1), "the arm doesn't reach it", 1),
    ],
)
def test_failures_are_told(objects, point, failure, label):
    lift = grasping().lift(objects, from_above(1, point))
    assert lift.failure.startswith(failure)
    assert lift.label == label
    assert not lift.lifted


def test_an_object_that_the_arm_does_not_reach_is_none_of_the_others():
    objects = {1: box([0.1] * 3, (2, 0, 0.05)), 2: box([0.1] * 3, (0, 0, 0.05))}
    lift = lifted(objects, from_above(1, (2, 0, 0.1)))
    assert lift.failure == "the arm doesn't reach it"
    assert set(lift.shifts) == {2}


def test_a_tower_is_taken_from_the_top_and_always_the_same_way():
    ranker = grasping(hidden=True)
    ranking = ranker.rank(TOWER, EYE)
    first = ranking.grasps[0]
    assert first.grasp.label == 3
    assert first.lift.lifted
    assert first.lift.disturbance < 1e-3
    lifted = [one for one in ranking.grasps if one.lift.lifted]
    assert len(lifted) > 1
    assert lifted == list(ranking.grasps[: len(lifted)])
    millimetres = [int(1000 * one.lift.disturbance) for one in lifted]
    assert millimetres == sorted(millimetres)
    for one, other in itertools.pairwise(lifted):  # the better seal among those that are alike
        if int(1000 * one.lift.disturbance) == int(1000 * other.lift.disturbance):
            assert one.grasp.seal >= other.grasp.seal
    assert all(one.lift.label == one.grasp.label for one in ranking.grasps if one.lift.lifted)
    again = pickle.loads(pickle.dumps(ranker)).rank(TOWER, EYE)
    assert [one.lift.disturbance for one in again.grasps] == [
        one.lift.disturbance for one in ranking.grasps
    ]


def test_the_arm_keeps_away_from_obstacles():
    """A sheet over the tower stands in the arm's way; one far behind the arm doesn't."""
    square = np.array([[-0.3, -0.3, 0.0], [0.3, -0.3, 0.0], [0.3, 0.3, 0.0], [-0.3, 0.3, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    ranker, grasp = grasping(), from_above(3, (0, 0, 0.16))
    for place, reached in (((0, 0, 0.3), False), ((-3.0, 0, 0.3), True)):
        sheet = TriangleMesh(square + place, faces)
        assert bool(ranker.lifting.feasible(TOWER, [grasp], 1, [sheet])) == reached


def test_what_floats_comes_to_rest_first():
    raised = {1: box((0.12, 0.12, 0.1), (0, 0, 0.09))}
    ranking = grasping().rank(raised, EYE)
    assert ranking.resting[1].pose.position[2] == pytest.approx(0.05, abs=2e-3)
    for one in ranking.grasps:
        fall = one.grasp.point - one.rehearsed.point
        np.testing.assert_allclose(fall, (0, 0, 0.04), atol=5e-3)


def test_without_objects_there_is_no_grasp():
    ranking = grasping().rank({}, EYE)
    assert ranking.grasps == ()
    assert ranking.left_out == {}


def test_the_arm_needs_pybullet():
    with pytest.raises(ConfigError, match="engine=pybullet"):
        LiftSimulation(MujocoEngine(), PandaArm(), SuctionCup())
