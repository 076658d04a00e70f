"""The chain of joints against PyBullet's arm."""

import numpy as np
import pytest

from scenefw_grasping.panda import PandaArm
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine

pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")

ARM = PandaArm(base=(0.1, -0.2, 0.05), turn=30.0)


def drawn(count):
    chain = ARM.chain
    return np.random.default_rng(2).uniform(chain.lower, chain.upper, (count, 7))


def test_forward_kinematics_are_those_of_the_simulated_arm():
    engine = PyBulletEngine()
    arm = ARM.enter(engine.world)
    angles = drawn(5)
    frames, tips = ARM.chain.forward(angles)
    for i, tip in enumerate(tips):
        arm.place(angles[i])
        np.testing.assert_allclose(arm.tip(), ARM.foot @ tip, atol=1e-5)
        np.testing.assert_allclose(arm.poses()[1:8], ARM.foot @ frames[i], atol=1e-5)


def test_most_poses_that_can_be_reached_are():
    poses = ARM.chain.forward(drawn(60))[1]
    angles, done = ARM.chain.anchors(poses)
    assert done.mean() > 0.6
    tips = ARM.chain.forward(angles[done])[1]
    np.testing.assert_allclose(tips, poses[done], atol=6e-3)
    assert (angles >= ARM.chain.lower).all()
    assert (angles <= ARM.chain.upper).all()


def test_what_is_out_of_reach_is_said_to_be():
    pose = np.eye(4)
    pose[:3, 3] = 2.0, 0, 0.5
    assert not ARM.chain.anchors(pose[None])[1].any()


def test_a_path_is_followed_without_jumps():
    way = np.tile(np.diag([1.0, -1, -1, 1]), (1, 6, 1, 1))
    way[0, :, :3, 3] = np.linspace((0.4, 0.1, 0.3), (0.5, -0.1, 0.1), 6)
    angles, done = ARM.chain.anchors(way[:, 0])
    found, fine = ARM.chain.path(way, angles, done)
    assert fine.all()
    assert np.abs(np.diff(found[0], axis=0)).max() < 0.5
    np.testing.assert_allclose(ARM.chain.forward(found[0])[1], way[0], atol=6e-3)
