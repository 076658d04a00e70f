import numpy as np
import pytest

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.report.shading import Solid, draw, turned

CAMERA = Camera(96, 72, 110.0, 110.0, 47.5, 35.5, look_at((0, -0.9, 0.6), (0, 0, 0.1)))


def ball(resolution, radius=0.12):
    grid = GridSpec(resolution=resolution)
    distance = np.linalg.norm(grid.centres() - (0, 0, radius), axis=-1) - radius
    tsdf = np.clip(distance, -grid.truncation, grid.truncation).astype(np.float32)
    return Solid(tsdf, (tsdf < 0).astype(np.int32), grid, [(0.9, 0.2, 0.1)])


@pytest.mark.parametrize("resolution", [32, 64])
def test_ball_has_its_colour_where_it_projects(resolution):
    picture = draw(ball(resolution), CAMERA)
    assert picture.shape == (72, 96, 3)
    assert picture.min() >= 0
    assert picture.max() <= 1
    red = picture[..., 0] - picture[..., 2] > 0.2
    rows, columns = np.nonzero(red)
    eye = CAMERA.T_world_camera
    local = (np.array((0, 0, 0.12)) - eye[:3, 3]) @ eye[:3, :3]
    middle = local[:2] / local[2] * 110 + (47.5, 35.5)
    np.testing.assert_allclose((columns.mean(), rows.mean()), middle, atol=2)
    radius = 110 * 0.12 / np.sqrt(local[2] ** 2 - 0.12**2)
    assert red.sum() == pytest.approx(np.pi * radius**2, rel=0.12)


def test_light_comes_from_above_and_a_shadow_falls():
    picture = draw(ball(64), CAMERA)
    red = picture[..., 0] - picture[..., 2] > 0.2
    rows = np.nonzero(red.any(axis=1))[0]
    upper, lower = rows[len(rows) // 4], rows[-len(rows) // 8]
    assert picture[upper][red[upper]].mean() > 1.3 * picture[lower][red[lower]].mean()
    floor = (np.ptp(picture, axis=-1) < 0.05) & ~red
    assert picture[floor].min() < 0.6
    assert np.median(picture[floor]) > 0.85


def test_empty_scene_is_floor_alone():
    solid = ball(32)
    empty = Solid(
        np.full_like(solid.tsdf, solid.grid.truncation), solid.instances * 0, solid.grid, []
    )
    picture = draw(empty, CAMERA)
    assert np.isfinite(picture).all()
    assert picture.min() > 0.6


@pytest.mark.parametrize("turn", [0.0, 70.0, 180.0])
def test_turned_camera_shows_all_points(turn):
    random = np.random.default_rng(0)
    points = random.uniform((-0.2, -0.1, 0), (0.1, 0.3, 0.4), (200, 3))
    camera = turned(CAMERA, points, turn)
    pose = camera.T_world_camera
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    pixels = local[:, :2] / local[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    assert (local[:, 2] > 0).all()
    size = np.array((camera.width, camera.height))
    assert (pixels > 0.05 * size).all()
    assert (pixels < 0.95 * size).all()
    filled = np.ptp(pixels, axis=0) / size
    assert filled.max() > 0.6
    before, after = CAMERA.T_world_camera[:3, 2], pose[:3, 2]
    angle = np.degrees(np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0]))
    assert angle % 360 == pytest.approx(turn, abs=1e-6)


def test_turned_camera_without_points():
    assert np.isfinite(turned(CAMERA, np.zeros((0, 3)), 90).T_world_camera).all()
