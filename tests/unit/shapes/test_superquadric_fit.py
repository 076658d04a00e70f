"""Superquadrics found again from points of their surface, some of them wrong, some unseen."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenefw.core.errors import ConfigError
from scenefw.core.types import Pose
from scenefw.shapes.superquadric import Superquadric
from scenefw.shapes.superquadric_fit import Evidence, SuperquadricFit, _Run

FIT = SuperquadricFit()


def drawn(seed, count=400):
    """A superquadric somewhere, its pose, and points of its surface with their normals."""
    rng = np.random.default_rng(seed)
    shape = Superquadric(rng.uniform(0.025, 0.12, 3), np.exp(rng.uniform(np.log(2), np.log(20), 3)))
    rotation = Rotation.random(rng=rng)
    pose = Pose(rng.uniform(-0.1, 0.1, 3), np.roll(rotation.as_quat(), 1))
    local = shape.project(rng.normal(size=(count, 3)) * shape.half_axes)
    points = local @ pose.rotation.T + pose.position
    return shape, pose, points, shape.normals(local) @ pose.rotation.T, rng


def starts(points):
    _, axes = np.linalg.eigh(np.cov(points.T))
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    found = []
    for rotation in (axes, np.eye(3), Rotation.from_euler("z", np.pi / 4).as_matrix()):
        local = points @ rotation
        low, high = np.percentile(local, (4, 96), axis=0)
        quaternion = np.roll(Rotation.from_matrix(rotation).as_quat(), 1)
        found.append((Pose(rotation @ ((low + high) / 2), quaternion), (high - low) / 2))
    return found


def evidence(points, sigma=0.002, **outside):
    return Evidence(points, np.full(len(points), sigma), **outside)


def overlap(shape, pose, found):
    """Intersection over union of two solids, by points in a box around the first."""
    rng = np.random.default_rng(1)
    places = pose.position + rng.uniform(-0.2, 0.2, (20000, 3))
    a = shape.value((places - pose.position) @ pose.rotation) < 1
    b = found.shape.value((places - found.pose.position) @ found.pose.rotation) < 1
    return (a & b).sum() / (a | b).sum()


@pytest.mark.parametrize("seed", range(6))
def test_half_axes_of_a_whole_surface_are_exact(seed):
    shape, pose, points, _, _ = drawn(seed)
    found = FIT.fit(evidence(points, sigma=0.0005), starts(points))
    # 24 descriptions of one shape: sorted half-axes are the same in all
    np.testing.assert_allclose(np.sort(found.shape.half_axes), np.sort(shape.half_axes), rtol=0.02)
    assert np.abs(found.distances).max() < 0.001
    assert overlap(shape, pose, found) > 0.96


@pytest.mark.parametrize("seed", range(4))
def test_a_fifth_of_the_points_may_be_wrong(seed):
    shape, pose, points, _, rng = drawn(seed)
    wrong = rng.random(len(points)) < 0.2
    points[wrong] += rng.normal(0, 0.05, (wrong.sum(), 3))
    found = FIT.fit(evidence(points), starts(points))
    assert overlap(shape, pose, found) > 0.9


@pytest.mark.parametrize("bounds", [(5.0, 100.0), (1.5, 3.0)])
def test_exponents_stay_within_any_bounds(bounds):
    _, _, points, _, _ = drawn(0)
    found = SuperquadricFit(exponents=bounds).fit(evidence(points), starts(points))
    assert np.isfinite(found.cost)
    assert (found.shape.exponents >= bounds[0]).all()
    assert (found.shape.exponents <= bounds[1]).all()


def test_places_outside_decide_what_is_not_seen():
    """A box of which one side is seen: the free places behind say how thick it is."""
    rng = np.random.default_rng(0)
    side = np.column_stack([rng.uniform(-0.1, 0.1, 300), np.zeros(300), rng.uniform(0, 0.2, 300)])
    behind = np.column_stack(
        [rng.uniform(-0.15, 0.15, 400), rng.uniform(0.04, 0.2, 400), rng.uniform(0, 0.25, 400)]
    )
    start = [(Pose(np.array([0.0, 0.06, 0.1]), np.array([1.0, 0, 0, 0])), np.full(3, 0.08))]
    free = FIT.fit(evidence(side), start)
    held = FIT.fit(evidence(side, outside=behind), start)
    thickness = [2 * one.shape.half_axes[1] for one in (free, held)]
    assert thickness[0] > 0.08
    assert thickness[1] < 0.055
    depth = held.shape.value((behind - held.pose.position) @ held.pose.rotation)
    assert (depth < 0.8).mean() < 0.05


@pytest.mark.parametrize("seed", range(3))
def test_slopes_are_those_of_finite_differences(seed):
    _, _, points, _, rng = drawn(seed, count=40)
    points += rng.normal(0, 0.01, points.shape)
    (pose, half_axes), *_ = starts(points)
    run = _Run(FIT, evidence(points, outside=points[:10] * 0.9), pose, half_axes)
    _, _, columns, _, gauge = run._distances()
    before, step = run.state(), 1e-6
    for number in range(12):
        change = np.zeros(12)
        change[number] = step
        run._move(change)
        moved = run._distances()[4]
        run.restore(before)
        np.testing.assert_allclose((moved - gauge) / step, columns[:, number], rtol=2e-3, atol=2e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"exponents": (0.5, 10)},
        {"half_axes": (0.2, 0.1)},
        {"steps": 0},
        {"outliers": 0},
        {"typical": -1},
    ],
)
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        SuperquadricFit(**wrong)
