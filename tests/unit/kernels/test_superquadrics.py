"""Signed distance of single points against ellipsoids, dense clouds and CUDA's simulator."""

import numba
import numpy as np
import pytest
import torch
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from scenefw.core.batches import SceneParameters
from scenefw.core.types import GridSpec
from scenefw.kernels.superquadrics import is_inside, signed_distance
from scenefw.representations.volumes import object_occupancy, scene_volumes


@numba.njit(cache=True)  # in a folder named by the sources of all kernels
def _distances(points, a, r, limit, out, inside):
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        out[i] = signed_distance(x, y, z, a[0], a[1], a[2], r[0], r[1], r[2], limit)
        inside[i] = is_inside(x / a[0], y / a[1], z / a[2], r[0], r[1], r[2])


def distances(points, half_axes, exponents, limit=10.0):
    """Signed distances of points (P, 3) of the positive octant."""
    points, a, r = (np.asarray(v, np.float32) for v in (points, half_axes, exponents))
    out, inside = np.empty(len(points), np.float32), np.empty(len(points), np.bool_)
    _distances(points, a, r, np.float32(limit), out, inside)
    assert ((out < 0) == inside).all()
    return out


def ellipsoid_distance(point, a) -> float:
    """Root of Eberly's function of the distance to an ellipsoid, float64."""

    def excess(t):
        return float((((a * point) / (t + a**2)) ** 2).sum() - 1)

    low, high = -(a.min() ** 2) * (1 - 1e-12), float(np.linalg.norm(a * point)) + 1
    t = brentq(excess, low, high, xtol=1e-15)
    q = a**2 * point / (t + a**2)
    return float(np.sign(t) * np.linalg.norm(point - q))


def surface_cloud(half_axes, exponents, side=120):
    """Dense points of the surface's positive octant."""
    a, r = np.asarray(half_axes, float), np.asarray(exponents, float)
    t = np.linspace(0, 1, side)
    grids = [np.meshgrid(g, g) for g in (t, 1 - (1 - t) ** 3)]
    u, v = (np.concatenate([g[i].ravel() for g in grids]) for i in (0, 1))
    one = np.ones_like(u)
    d = np.concatenate([np.stack(c, 1) for c in ([u, v, one], [u, one, v], [one, u, v])])
    low, high = np.full(len(d), -6.0), np.zeros(len(d))
    logs = np.log(np.maximum(d, 1e-300))
    for _ in range(40):
        middle = (low + high) / 2
        outside = np.exp(r * (logs + middle[:, None])).sum(1) > 1
        high, low = np.where(outside, middle, high), np.where(outside, low, middle)
    return a * d * np.exp(low)[:, None]


def test_ellipsoid():
    rng = np.random.default_rng(0)
    a = np.array([0.05, 0.09, 0.14])
    points = rng.uniform(0.01, 1, (300, 3)) * (a + 0.08)
    truth = [ellipsoid_distance(p, a) for p in points]
    found = distances(points, a, [2, 2, 2])
    assert np.abs(found - truth).max() < 3e-4


@pytest.mark.parametrize(
    "exponents",
    [(3, 5, 2), (2, 40, 100), (1.1, 1.3, 1.2)],
)
def test_dense_cloud(exponents):
    rng = np.random.default_rng(1)
    a = np.array([0.06, 0.15, 0.03])
    points = rng.uniform(0, 1, (1000, 3)) * (a + 0.08)
    points[:100, 0], points[100:200, :2] = 0, 0  # planes and axes of symmetry
    cloud = surface_cloud(a, exponents)
    truth = cKDTree(cloud).query(points)[0]
    found = distances(points, a, exponents)
    assert np.abs(np.abs(found) - truth).max() < 1.6e-3  # a tenth of a voxel of 64^3
    assert np.abs(np.abs(found) - truth).mean() < 1e-4


def test_extreme_points_are_finite():
    a = np.array([0.025, 0.15, 0.1])
    points = np.array([[0, 0, 0], a, [0.025, 0, 0], [3, 0, 0], [3, 3, 3], [1e-9, 0.2, 1e-12]])
    found = distances(points, a, [100, 2, 50])
    assert np.isfinite(found).all()
    assert found[0] == pytest.approx(-0.025, abs=1e-4)
    assert found[2] == pytest.approx(0, abs=1e-4)
    assert found[3] == pytest.approx(2.975, abs=1e-3)


def test_limit_never_changes_what_is_nearer():
    rng = np.random.default_rng(2)
    a, r = np.array([0.1, 0.05, 0.12]), [4, 30, 8]
    points = rng.uniform(0, 0.25, (2000, 3))
    full, cut = distances(points, a, r), distances(points, a, r, limit=0.04)
    near = full < 0.0399
    assert np.allclose(full[near], cut[near], atol=1e-6)
    assert (cut[~near] > 0.0389).all()


def results():
    """Volumes of two scenes, the second of one object, by name."""
    grid = GridSpec(resolution=6, extent=0.5, lower=(-0.25, -0.25, -0.05), truncation_voxels=2)
    parameters = SceneParameters(
        torch.tensor([[[0.1, 0.05, 0.12], [0.08, 0.15, 0.07]]] * 2),
        torch.tensor([[[2.0, 100, 7], [30, 2, 2.5]]] * 2),
        torch.eye(3).expand(2, 2, 3, 3),
        torch.tensor([[[0.0, 0.05, 0.1], [0.1, -0.1, 0.2]], [[0.1, 0, 0.1], [-0.1, 0, 0.2]]]),
        torch.tensor([[True, True], [True, False]]),
    )
    volumes = scene_volumes(parameters, grid)
    found = {name: getattr(volumes, name) for name in ("tsdf", "votes", "instances")}
    found["occupancy"] = object_occupancy(parameters, grid)
    return {name: value.numpy() for name, value in found.items()}


@pytest.mark.exhaustive
def test_cuda_path_equals_cpu(simulated):
    ours = results()
    assert (ours["instances"] > 0).any()
    for name in ("tsdf", "votes"):
        np.testing.assert_allclose(simulated[name], ours[name], rtol=1e-5, atol=1e-5)
    for name in ("instances", "occupancy"):
        np.testing.assert_array_equal(simulated[name], ours[name])
