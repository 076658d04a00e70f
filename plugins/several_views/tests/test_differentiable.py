"""Costs of depth images: zero for the truth, the right sign elsewhere, gradients as differences."""

import numpy as np
import pytest
import torch

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw_several_views.differentiable import Differentiable, thinned

GRID = GridSpec(resolution=24)
CENTRE, RADIUS = np.array([0.02, -0.03, 0.2]), 0.15


def sphere(radius=RADIUS):
    """Exact distances, not truncated, so that interpolation errors are small."""
    away = np.linalg.norm(GRID.centres() - CENTRE, axis=-1) - radius
    return torch.from_numpy(away.astype(np.float32))


def cameras():
    eyes = ((0.9, 0.1, 0.6), (-0.5, 0.7, 0.5))
    poses = [look_at(np.array(eye), CENTRE) for eye in eyes]
    return stack_cameras([Camera(40, 30, 45.0, 45.0, 19.5, 14.5, pose) for pose in poses])


def depths():
    """Of the sphere and the floor, by formula."""
    views, images = cameras(), []
    for lens, pose in zip(views.intrinsics.numpy(), views.T_world_camera.numpy(), strict=True):
        u, v = np.meshgrid(np.arange(40), np.arange(30))
        rays = np.stack([(u - lens[2]) / lens[0], (v - lens[3]) / lens[1], np.ones(u.shape)], -1)
        rays = rays @ pose[:3, :3].T
        gap = pose[:3, 3] - CENTRE
        a, b, c = (rays**2).sum(-1), rays @ gap, gap @ gap - RADIUS**2
        inner = b**2 - a * c
        hit = (-b - np.sqrt(np.maximum(inner, 0))) / a
        floor = np.where(rays[..., 2] < 0, -pose[2, 3] / np.minimum(rays[..., 2], -1e-9), 0)
        images.append(np.where(inner > 0, hit, floor))
    return torch.from_numpy(np.stack(images).astype(np.float32))


def test_the_truth_costs_nothing_and_both_kinds_of_errors_cost():
    renderer, views = Differentiable(stride=1), cameras()
    true, small, large = (
        [float(c) for c in renderer.costs(sphere(r), GRID, depths(), views)]
        for r in (RADIUS, RADIUS - 0.04, RADIUS + 0.04)
    )
    on_sphere = float((np.abs(_heights()) > 0.005).mean())
    assert true[0] < 0.003 * on_sphere
    assert true[1] == pytest.approx(0, abs=1e-4)
    assert small[0] == pytest.approx(0.04 * on_sphere, rel=0.1)  # too small: points lie outside
    assert small[1] == 0
    assert large[0] == pytest.approx(0.04 * on_sphere, rel=0.1)
    assert large[1] > 0.01  # too large: it fills seen space


def _heights():
    views = cameras()
    lens, pose = views.intrinsics.numpy()[0], views.T_world_camera.numpy()
    u, v = np.meshgrid(np.arange(40), np.arange(30))
    rays = np.stack([(u - lens[2]) / lens[0], (v - lens[3]) / lens[1], np.ones(u.shape)], -1)
    images = depths().numpy()
    return np.stack([p[2, 3] + d * (rays @ p[2, :3]) for p, d in zip(pose, images, strict=True)])


@pytest.mark.parametrize("which", [0, 1])
def test_gradients_are_finite_differences(which):
    renderer, views, images = Differentiable(stride=2), cameras(), depths()
    volume = sphere(RADIUS + 0.03).requires_grad_()
    renderer.costs(volume, GRID, images, views)[which].backward()
    slope, rng = volume.grad, np.random.default_rng(3)
    touched = torch.nonzero(slope)
    assert len(touched) > 100
    picked = touched[rng.choice(len(touched), 12, replace=False)]
    for place in [tuple(row.tolist()) for row in picked]:
        change = torch.zeros(GRID.shape)
        change[place] = 1e-3
        up, down = (
            float(renderer.costs((volume.detach() + s * change), GRID, images, views)[which])
            for s in (1, -1)
        )
        assert (up - down) / 2e-3 == pytest.approx(float(slope[place]), rel=0.05, abs=2e-4)


def test_thinned_cameras_look_along_the_same_rays():
    small, views = thinned(depths(), cameras(), 3)
    assert small.shape == (2, 10, 14)
    lens = views.intrinsics[0].numpy()
    whole = cameras().intrinsics[0].numpy()
    assert (4 - lens[2]) / lens[0] == pytest.approx((12 - whole[2]) / whole[0])


def test_mistakes_are_told():
    with pytest.raises(ConfigError, match="step"):
        Differentiable(step=0)
    with pytest.raises(InputError, match="no pixel"):
        Differentiable().costs(sphere(), GRID, torch.zeros(2, 30, 40), cameras())
    with pytest.raises(InputError, match="one scene"):
        Differentiable().costs(sphere()[None], GRID, depths(), cameras())
