"""Superquadrics found again from points of their surface, some of them wrong, some unseen."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from scenefw.core.errors import ConfigError
from scenefw.core.evidence import Evidence, FittedSuperquadric
from scenefw.core.types import Pose
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.kernels.superquadric_fit import COST, LANES, STATE, TYPICAL, WORK, advance
from scenefw.shapes.superquadric import Superquadric

FIT = SuperquadricFit()
NOWHERE = np.empty((0, 3))
LOW, HIGH = np.log(1.6), np.log(100)


def drawn(seed, count=400):
    """A superquadric somewhere, its pose, and points of its surface with their normals."""
    rng = np.random.default_rng(seed)
    shape = Superquadric(rng.uniform(0.025, 0.12, 3), np.exp(rng.uniform(np.log(2), np.log(20), 3)))
    rotation = Rotation.random(rng=rng)
    pose = Pose(rng.uniform(-0.1, 0.1, 3), np.roll(rotation.as_quat(), 1))
    local = shape.project(rng.normal(size=(count, 3)) * shape.half_axes)
    points = local @ pose.rotation.T + pose.position
    return shape, pose, points, shape.normals(local) @ pose.rotation.T, rng


def fit(given, method=FIT):
    (found,) = method.fit([given])
    return found


def evidence(points, sigma=0.002, outside=NOWHERE):
    deep = np.full(len(outside), 0.004)
    return Evidence(points, np.full(len(points), sigma), outside, deep)


def overlap(shape, pose, found):
    """Intersection over union of two solids, by points in a box around the first."""
    rng = np.random.default_rng(1)
    places = pose.position + rng.uniform(-0.2, 0.2, (20000, 3))
    a = shape.value((places - pose.position) @ pose.rotation) < 1
    b = (
        Superquadric(found.half_axes, found.exponents).value(
            (places - found.pose.position) @ found.pose.rotation
        )
        < 1
    )
    return (a & b).sum() / (a | b).sum()


@pytest.mark.parametrize("seed", range(6))
def test_half_axes_of_a_whole_surface_are_exact(seed):
    shape, pose, points, _, _ = drawn(seed)
    found = fit(evidence(points, sigma=0.0005))
    # 24 descriptions of one shape: sorted half-axes are the same in all
    np.testing.assert_allclose(np.sort(found.half_axes), np.sort(shape.half_axes), rtol=0.02)
    assert np.abs(found.distances).max() < 0.001
    assert overlap(shape, pose, found) > 0.96


@pytest.mark.parametrize("seed", range(4))
def test_a_fifth_of_the_points_may_be_wrong(seed):
    shape, pose, points, _, rng = drawn(seed)
    wrong = rng.random(len(points)) < 0.2
    points[wrong] += rng.normal(0, 0.05, (wrong.sum(), 3))
    found = fit(evidence(points))
    assert overlap(shape, pose, found) > 0.9


@pytest.mark.parametrize("bounds", [(5.0, 100.0), (1.5, 3.0)])
def test_exponents_stay_within_any_bounds(bounds):
    _, _, points, _, _ = drawn(0)
    found = fit(evidence(points), SuperquadricFit(exponents=bounds))
    assert np.isfinite(found.cost)
    assert (found.exponents >= bounds[0]).all()
    assert (found.exponents <= bounds[1]).all()


def test_places_outside_decide_what_is_not_seen():
    """A box of which one side is seen: the free places behind say how thick it is."""
    rng = np.random.default_rng(0)
    side = np.column_stack([rng.uniform(-0.1, 0.1, 300), np.zeros(300), rng.uniform(0, 0.2, 300)])
    behind = np.column_stack(
        [rng.uniform(-0.15, 0.15, 400), rng.uniform(0.04, 0.2, 400), rng.uniform(0, 0.25, 400)]
    )
    pose = Pose(np.array([0.0, 0.06, 0.1]), np.array([1.0, 0, 0, 0]))
    start = FittedSuperquadric(np.full(3, 0.08), np.full(3, 4.0), pose, 0.0, np.zeros(0))
    given = [evidence(side), evidence(side, outside=behind)]
    free, held = FIT.refit(given, [start] * 2)
    assert 2 * free.half_axes[1] > 0.08
    assert 2 * held.half_axes[1] < 0.055
    shape = Superquadric(held.half_axes, held.exponents)
    depth = shape.value((behind - held.pose.position) @ held.pose.rotation)
    assert (depth < 0.8).mean() < 0.05


def test_draws_agree_where_points_decide_and_differ_where_they_do_not():
    """All of one object is seen, and one side of a box."""
    _, _, points, _, rng = drawn(0)
    side = np.column_stack([rng.uniform(-0.1, 0.1, 300), np.zeros(300), rng.uniform(0, 0.2, 300)])
    # Free space in front of the side says in which direction the box goes on
    front = np.column_stack(
        [rng.uniform(-0.2, 0.2, 400), rng.uniform(-0.2, -0.005, 400), rng.uniform(0, 0.3, 400)]
    )
    given = [evidence(points), evidence(side, outside=front)]
    best = FIT.fit(given)
    draws = FIT.draws(given, best, 8, np.random.default_rng(3))
    assert len(draws) == 8
    seen, open_ended = (np.array([each[k].half_axes for each in (best, *draws)]) for k in (0, 1))
    assert np.ptp(np.sort(seen, axis=1), axis=0).max() < 0.002
    assert np.ptp(open_ended, axis=0).max() > 0.02
    for _, found in draws:
        assert np.median(np.abs(found.distances)) < 0.002
    again = FIT.draws(given, best, 2, np.random.default_rng(3))
    np.testing.assert_array_equal(again[1][1].half_axes, draws[1][1].half_axes)
    narrow = SuperquadricFit(spread=0.05).draws(given, best, 8, np.random.default_rng(3))
    assert np.ptp([d[1].half_axes for d in narrow], axis=0).max() < 0.02


def test_objects_fitted_together_come_out_as_alone():
    several = [drawn(seed)[2] for seed in range(3)]
    together = FIT.fit([evidence(points) for points in several])
    for points, found in zip(several, together, strict=True):
        alone = fit(evidence(points))
        np.testing.assert_allclose(found.half_axes, alone.half_axes)
        assert found.cost == alone.cost
    assert FIT.fit([]) == FIT.refit([], []) == []


TYPICAL_AXES = (0.06, 0.05, 0.08)  # m


def state_of(start, exponents):
    """A row of the kernel's states."""
    pose, half_axes = start
    row = np.zeros((1, STATE))
    row[0, :3], row[0, 3:12] = pose.position, pose.rotation.ravel()
    row[0, 12:15], row[0, TYPICAL:] = np.log(half_axes), np.log(TYPICAL_AXES)
    row[0, 15:18] = -np.log((HIGH - LOW) / (np.log(exponents) - LOW) - 1)
    return row


def moved(row, number, step):
    """The state after a small step of one of its twelve numbers."""
    row, rotation = row.copy(), row[0, 3:12].reshape(3, 3)
    change = np.zeros(12)
    change[number] = step
    row[0, :3] += rotation @ change[:3]
    row[0, 3:12] = (rotation @ Rotation.from_rotvec(change[3:6]).as_matrix()).ravel()
    row[0, 12:18] += change[6:]
    return row


def cost_and_slope(row, points, outside, sigma, limit):
    """By the kernel, which takes no step."""
    sizes = [0, len(points), len(points) + len(outside)]
    work, lanes = torch.zeros(1, WORK, dtype=torch.float64), torch.zeros(1, LANES)
    states = torch.from_numpy(row.copy())
    places = torch.from_numpy(np.concatenate([points, outside]).astype(np.float32))
    settings = torch.tensor([LOW, HIGH, -5, 0, 0.3], dtype=torch.float64)
    sigmas = torch.full((len(places),), sigma)
    objects = torch.tensor([sizes], dtype=torch.int32)
    advance(1, places, sigmas, objects, states, work, lanes, settings, 0, limit)
    return float(states[0, COST]), work[0, 144:156].numpy() * 2 / len(points)


def cost_by_definition(row, points, outside, sigma, limit):
    exponents = np.exp(LOW + (HIGH - LOW) / (1 + np.exp(-row[0, 15:18])))
    shape = Superquadric(np.exp(row[0, 12:15]), exponents)
    rotation = row[0, 3:12].reshape(3, 3)

    def residuals(places):
        return shape.first_order_distance((places - row[0, :3]) @ rotation) / sigma

    on, off = residuals(points) ** 2, np.minimum(residuals(outside), 0) ** 2
    size, free = row[0, 12:15] - np.log(TYPICAL_AXES), row[0, 15:18]
    uncommon = 0.3 * (size**2).sum() + 0.075 * (free**2).sum()
    return ((on / (1 + on / limit**2)).sum() + off.sum() + uncommon) / len(points)


@pytest.mark.parametrize("seed", range(3))
def test_cost_and_slope_of_the_kernel(seed):
    shape, pose, points, _, rng = drawn(seed, count=200)
    points = points + rng.normal(0, 2e-4, points.shape)
    inside = pose.position + 0.97 * (points[:50] - pose.position)
    row = state_of((pose, shape.half_axes), shape.exponents)
    given = (points, inside, 0.002, 3.0)
    assert cost_and_slope(row, *given)[0] == pytest.approx(
        cost_by_definition(row, *given), rel=1e-3
    )
    # The slope takes the length of the gradient for constant, which is exact on the surface
    given = (points, NOWHERE, 0.002, 3.0)
    slope = cost_and_slope(row, *given)[1]
    for number in range(12):
        step = 1e-6
        ends = [cost_by_definition(moved(row, number, s), *given) for s in (-step, step)]
        difference = (ends[1] - ends[0]) / (2 * step)
        assert slope[number] == pytest.approx(difference, rel=0.1, abs=0.03 * np.abs(slope).max())


@pytest.mark.parametrize(
    "wrong",
    [
        {"exponents": (0.5, 10)},
        {"half_axes": (0.2, 0.1)},
        {"steps": 0},
        {"typical": -1},
    ],
)
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        SuperquadricFit(**wrong)
