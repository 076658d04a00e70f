"""Inverse kinematics of many poses at once, by damped least squares (Wampler 1986).

PyBullet's takes one pose at a time, and from one start it misses a third of those that the arm
reaches.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np

from scenefw.core.geometry import rigid
from scenefw.core.types import Float64

_DAMPING = 0.02
_STEP = 0.4  # radians of a joint in a round at most
_TURN = 0.15  # m that a radian counts as
_OFF, _TURNED = 1e-3, 5e-3  # m and radians that a reached pose may be off
_JUMP = 1.0  # radians of a joint between poses of a path at most
_MARGIN = 0.01  # radians from a joint's limits


class Chain:
    """Revolute joints one after the other, each about the z axis of its frame.

    Args:
        joints: poses (N, 4, 4) of the joints' frames in the frame before, at angle 0.
        tip: (4, 4) pose of the tip in the last joint's frame.
        limits: (N, 2) lowest and highest angles (radians).
        rest_angles: (N,) angles that starts are near to.
    """

    def __init__(
        self, joints: Float64, tip: Float64, limits: Float64, rest_angles: Float64
    ) -> None:
        self.joints, self.tip = joints, tip
        self.lower, self.upper = limits[:, 0] + _MARGIN, limits[:, 1] - _MARGIN
        self.rest_angles = rest_angles

    def forward(self, angles: Float64) -> tuple[Float64, Float64]:
        """Frames of the joints (B, N, 4, 4) and of the tip (B, 4, 4) at angles (B, N)."""
        c, s = np.cos(angles), np.sin(angles)
        frames = []
        frame = np.broadcast_to(np.eye(4), (len(angles), 4, 4))
        for i, joint in enumerate(self.joints):
            turn = np.zeros((len(angles), 4, 4))
            turn[:, 0, 0], turn[:, 0, 1] = c[:, i], -s[:, i]
            turn[:, 1, 0], turn[:, 1, 1] = s[:, i], c[:, i]
            turn[:, 2, 2] = turn[:, 3, 3] = 1
            frame = frame @ joint @ turn
            frames.append(frame)
        return np.stack(frames, axis=1), frame @ self.tip

    def solve(
        self, poses: Float64, starts: Float64, rounds: int = 40
    ) -> tuple[Float64, np.ndarray]:
        """Angles (B, N) that bring the tip to poses (B, 4, 4), and whether they do (B,) bool.

        Args:
            poses: in the frame of the chain's foot.
            starts: (B, N) angles to begin with.
            rounds: at most.
        """
        angles, converged = starts.copy(), np.zeros(len(starts), dtype=bool)
        for _ in range(rounds):
            todo = np.flatnonzero(~converged)
            frames, tip = self.forward(angles[todo])
            error = _difference(tip, poses[todo])
            off = np.linalg.norm(error[:, :3], axis=1)
            turned = np.linalg.norm(error[:, 3:], axis=1)
            converged[todo] = (off < _OFF) & (turned < _TURNED)
            if converged[todo].all():
                break
            step = _step(frames, tip, error)
            angles[todo] = np.clip(angles[todo] + step, self.lower, self.upper)
        return angles, converged

    def anchors(self, poses: Float64) -> tuple[Float64, np.ndarray]:
        """Angles and success as of `solve`, from several starts one after the other."""
        angles, converged = (
            np.tile(self.rest_angles, (len(poses), 1)),
            np.zeros(len(poses), dtype=bool),
        )
        azimuth = np.arctan2(poses[:, 1, 3], poses[:, 0, 3])
        for start in _starts(self.rest_angles):
            todo = np.flatnonzero(~converged)
            if not len(todo):
                break
            begin = np.tile(start, (len(todo), 1))
            begin[:, 0] = azimuth[todo]
            begin = np.clip(begin, self.lower, self.upper)
            angles[todo], converged[todo] = self.solve(poses[todo], begin)
        return angles, converged

    def path(
        self, poses: Float64, angles: Float64, active: np.ndarray
    ) -> tuple[Float64, np.ndarray]:
        """Angles (B, P, N) that follow poses (B, P, 4, 4), each from the last, and success (B,).

        Args:
            poses: of B ways.
            angles: (B, N) near the first poses.
            active: (B,) ways to follow.
        """
        waypoints, fine = [], active.copy()
        for i in range(poses.shape[1]):
            after, reached = self.solve(poses[:, i], angles, rounds=25)
            fine &= reached & (np.abs(after - angles).max(axis=1) < _JUMP)
            waypoints.append(after)
            angles = after
        return np.stack(waypoints, axis=1), fine


def read_chain(robot: Element, names: Sequence[str], rest_angles: Float64, tip: Float64) -> Chain:
    """The chain of some joints of a URDF, all about z.

    Args:
        robot: the URDF's root.
        names: of the joints, one after the other.
        rest_angles: angles (N,).
        tip: (4, 4) in the frame of the last joint.
    """
    joints = {joint.get("name"): joint for joint in robot.findall("joint")}
    frames, limits = [], []
    for name in names:
        origin, limit = joints[name].find("origin"), joints[name].find("limit")
        assert origin is not None, name
        assert limit is not None, name
        frames.append(_frame(_numbers(origin, "xyz"), _numbers(origin, "rpy")))
        limits.append([float(limit.get("lower", 0)), float(limit.get("upper", 0))])
    return Chain(np.array(frames), tip, np.array(limits), rest_angles)


def _numbers(element: Element, name: str) -> Float64:
    return np.array([float(word) for word in element.get(name, "0 0 0").split()])


def _frame(xyz: Float64, rpy: Float64) -> Float64:
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return rigid(about_z @ about_y @ about_x, xyz)


def _starts(rest_angles: Float64) -> Float64:
    """Angles (S, N) around the rest position, always the same."""
    offsets = np.random.default_rng(0).normal(0, 0.7, (4, len(rest_angles)))
    return rest_angles + np.concatenate([np.zeros((1, len(rest_angles))), offsets])


def _difference(tip: Float64, poses: Float64) -> Float64:
    """(B, 6): what is missing in position (m) and rotation (radians about axes of the foot)."""
    turn = poses[:, :3, :3] @ tip[:, :3, :3].swapaxes(1, 2)
    skew = turn - turn.swapaxes(1, 2)
    axis = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, np.trace(turn, axis1=1, axis2=2) - 1)
    # Half a turn has no axis here: any will do, the next round has one
    unit = np.where(sine[:, None] > 1e-9, axis / np.maximum(sine, 1e-9)[:, None], [1.0, 0.0, 0.0])
    return np.concatenate([poses[:, :3, 3] - tip[:, :3, 3], unit * angle[:, None]], axis=1)


def _step(frames: Float64, tip: Float64, error: Float64) -> Float64:
    """Changes of angles (B, N) that reduce an error (B, 6)."""
    axes = frames[:, :, :3, 2]
    arms = tip[:, None, :3, 3] - frames[:, :, :3, 3]
    jacobian = np.concatenate([np.cross(axes, arms), _TURN * axes], axis=2)  # (B, N, 6)
    square = jacobian.swapaxes(1, 2) @ jacobian + _DAMPING**2 * np.eye(6)
    scaled = error * np.array([1, 1, 1, _TURN, _TURN, _TURN])
    step = (jacobian @ np.linalg.solve(square, scaled[:, :, None]))[:, :, 0]
    return step * np.minimum(1.0, _STEP / np.maximum(np.abs(step).max(axis=1), 1e-9))[:, None]
