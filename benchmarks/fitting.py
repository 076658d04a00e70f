"""Superquadrics fitted to half-seen objects, beside SciPy's dogleg method (thesis 5.2.5)."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from benchmarks.harness import Job
from scenefw.core.evidence import Evidence
from scenefw.core.types import Pose
from scenefw.fitting.joint import JointFit
from scenefw.fitting.starts import box_starts
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.shapes.superquadric import Superquadric

_SIGMA = 0.002
_LOW = np.r_[np.full(3, -1.0), np.full(3, -7.0), np.full(3, np.log(0.008)), np.full(3, np.log(1.6))]
_HIGH = np.r_[np.full(3, 1.0), np.full(3, 7.0), np.full(3, np.log(0.5)), np.full(3, np.log(100))]


def half_seen(seed: int) -> Evidence:
    """400 points on the upper half of a superquadric, 2 mm of noise, and places above it."""
    rng = np.random.default_rng(seed)
    shape = Superquadric(rng.uniform(0.03, 0.1, 3), np.exp(rng.uniform(np.log(2), np.log(20), 3)))
    rotation = Rotation.random(rng=rng).as_matrix()
    centre = np.array([0.16 * seed, 0.0, 0.0])
    local = shape.project(rng.normal(size=(1200, 3)) * shape.half_axes)
    points = local @ rotation.T
    points = points[points[:, 2] > 0][:400]
    outside = 1.3 * points[::2] + centre
    noisy = points + centre + rng.normal(0, _SIGMA, points.shape)
    sigmas = np.full(len(points), _SIGMA)
    return Evidence(noisy, sigmas, outside, np.full(len(outside), 0.004))


def alone() -> Callable[[], object]:
    fit, evidence = SuperquadricFit(), [half_seen(0)]
    return lambda: fit.fit(evidence)


def together() -> Callable[[], object]:
    fit, evidence = JointFit(SuperquadricFit()), [half_seen(seed) for seed in range(4)]
    return lambda: fit.separate(evidence, fit.fit(evidence))


def scipy(count: int) -> Callable[[], Callable[[], object]]:
    """From the same starts, with derivatives by differences; the best of them."""

    def fitted(evidence: Evidence) -> float:
        places = np.concatenate([evidence.points, evidence.outside])

        def residuals(numbers: np.ndarray) -> np.ndarray:
            shape = Superquadric(np.exp(numbers[6:9]), np.exp(numbers[9:]))
            rotation = Rotation.from_rotvec(numbers[3:6]).as_matrix()
            distance = shape.first_order_distance((places - numbers[:3]) @ rotation)
            distance[len(evidence.points) :] = np.minimum(distance[len(evidence.points) :], 0)
            return distance / _SIGMA

        costs = []
        for pose, half_axes in box_starts(evidence.points):
            start = np.clip(_numbers(pose, half_axes), _LOW + 1e-6, _HIGH - 1e-6)
            found = least_squares(
                residuals, start, bounds=(_LOW, _HIGH), method="dogbox", loss="soft_l1", max_nfev=60
            )
            costs.append(found.cost)
        return min(costs)

    def ready() -> Callable[[], object]:
        evidence = [half_seen(seed) for seed in range(count)]
        return lambda: [fitted(one) for one in evidence]

    return ready


def _numbers(pose: Pose, half_axes: np.ndarray) -> np.ndarray:
    turn = Rotation.from_matrix(pose.rotation).as_rotvec()
    return np.r_[pose.position, turn, np.log(half_axes), np.full(3, np.log(4.0))]


JOBS = [
    Job("superquadric of one half-seen object", alone, {"scipy dogbox": scipy(1)}),
    Job("superquadrics of four objects together", together, {"scipy dogbox, alone": scipy(4)}),
]
