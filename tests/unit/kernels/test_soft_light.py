"""Against closed forms, and against the same light by scipy's interpolation."""

import numpy as np
import pytest
import torch
from scipy import ndimage

from scenefw.core.types import GridSpec
from scenefw.kernels import soft_light

KEY = np.array([0.48, -0.36, 0.8])
UP = np.array([0.0, 0.0, 1.0])


def ball(grid, centre=(0.0, 0.0, 0.12), radius=0.1):
    return (np.linalg.norm(grid.centres() - centre, axis=-1) - radius).astype(np.float32)


def lit(field, grid, points, normals):
    tensors = [torch.from_numpy(np.asarray(one, np.float32)) for one in (points, normals)]
    return soft_light.brightness_of(torch.from_numpy(field), grid, *tensors, tuple(KEY)).numpy()


def by_scipy(field, grid, points, normals):
    """The same with distances by another library, all points at once."""

    def distance(where):
        return ndimage.map_coordinates(field, grid.to_voxels(where).T, order=1, mode="nearest")

    blocked = 0
    for i, step in enumerate((0.008, 0.02, 0.045, 0.08)):
        ahead = points + step * normals
        free = np.minimum(distance(ahead), np.abs(ahead[:, 2]))
        blocked = blocked + 0.5**i * np.clip(1 - free / step, 0, 1)
    shadow = 1
    for step in np.geomspace(0.012, 0.35, 9):
        free = distance(points + 0.004 * normals + step * KEY)
        shadow = np.minimum(shadow, np.clip(9 * free / step, 0, 1))
    is_open = np.clip(1 - 0.6 * blocked / 1.3, 0.35, 1)
    sky = 0.5 + 0.5 * normals[:, 2]
    return (0.42 + 0.22 * sky) * is_open + 0.46 * np.clip(normals @ KEY, 0, 1) * shadow


@pytest.mark.parametrize("resolution", [24, 64])
def test_light_is_that_of_another_interpolation(resolution):
    random = np.random.default_rng(0)
    grid = GridSpec(resolution)
    field = ball(grid)
    points = random.uniform((-0.6, -0.6, 0), (0.6, 0.6, 0.5), (2000, 3))  # some beyond the cube
    normals = random.normal(size=(2000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    expected = by_scipy(field, grid, points, normals)
    np.testing.assert_allclose(lit(field, grid, points, normals), expected, atol=2e-4)


def test_an_open_floor_is_bright_and_a_shadow_dark():
    grid = GridSpec(64)
    far = np.full(grid.shape, 1.0, np.float32)
    points, normals = np.zeros((1, 3)), UP[None]
    # Of the floor itself, |z| of the way up is free: nothing is blocked
    assert lit(far, grid, points, normals)[0] == pytest.approx(0.42 + 0.22 + 0.46 * KEY[2])
    behind = -KEY[:2] / KEY[2] * 0.12  # on the line through the ball's middle to the light
    shaded = lit(ball(grid), grid, np.array([[*behind, 0.0]]), normals)[0]
    assert shaded < 0.7


def test_the_map_of_the_floor_is_brightness_at_its_places():
    grid = GridSpec(32)
    field = torch.from_numpy(ball(grid))
    found = soft_light.floor_map(field, grid, 0.5, 11, tuple(KEY)).numpy()
    axis = np.linspace(-0.5, 0.5, 11)
    for row, column in ((0, 0), (3, 8), (10, 5)):
        place = np.array([[axis[column], axis[row], 0.0]])
        alone = lit(field.numpy(), grid, place, UP[None])[0]
        assert found[row, column] == pytest.approx(alone, abs=1e-5)


def test_no_point_has_no_brightness():
    grid = GridSpec(16)
    nothing = np.zeros((0, 3))
    assert lit(ball(grid), grid, nothing, nothing).shape == (0,)
