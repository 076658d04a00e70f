"""Boxes on the floor, for tests of grasps."""

import numpy as np

from scenefw.core.types import Pose, SceneObject
from scenefw.shapes.superquadric import Superquadric
from scenefw_grasping.candidates import SuctionCandidates
from scenefw_grasping.lifting import LiftSimulation
from scenefw_grasping.panda import PandaArm
from scenefw_grasping.ranking import SuctionGrasping
from scenefw_grasping.suction import SuctionCup
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine

EYE = np.array([0.3, -0.8, 0.9])


def box(sides, middle, mass=0.5, exponent=60):
    half = np.array(sides) / 2
    pose = Pose(np.array(middle, dtype=float), np.array([1.0, 0, 0, 0]))
    return SceneObject(Superquadric(half, np.full(3, float(exponent))), pose, mass)


TOWER = {  # a lid lies half on a block and half on another
    1: box((0.10, 0.10, 0.12), (0.0, 0.09, 0.06)),
    2: box((0.10, 0.10, 0.12), (0.0, -0.09, 0.06)),
    3: box((0.10, 0.26, 0.04), (0.0, 0.0, 0.14), mass=0.3),
}


def grasping(**changes):
    cup = SuctionCup()
    lifting = LiftSimulation(PyBulletEngine(), PandaArm(), cup)
    return SuctionGrasping(SuctionCandidates(cup, points=60, **changes), lifting, contacts=2)
