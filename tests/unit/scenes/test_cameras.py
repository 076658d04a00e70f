"""Random viewpoints: where they stand, where they look, which image they make."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenefw.core.errors import ConfigError
from scenefw.scenes.cameras import RandomViewpoints


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_cameras_stand_where_they_may_and_look_at_the_centre(seed):
    camera = RandomViewpoints().sample(np.random.default_rng(seed))
    position = camera.T_world_camera[:3, 3]
    assert (np.abs(position[:2]) <= 1).all()
    assert 0.1 <= position[2] <= 1
    centre = np.array([0, 0, 0.1])
    assert np.linalg.norm(position - centre) >= 0.78
    x, y, z = camera.T_world_camera[:3, :3].T @ (centre - position)
    assert z > 0.7  # in front
    assert abs(camera.fx * x / z + camera.cx - 319.5) < 60
    assert abs(camera.fy * y / z + camera.cy - 239.5) < 60


def test_positions_fill_the_box():
    rng = np.random.default_rng(0)
    source = RandomViewpoints()
    positions = np.array([source.sample(rng).T_world_camera[:3, 3] for _ in range(300)])
    np.testing.assert_allclose(positions.min(axis=0), [-1, -1, 0.1], atol=0.08)
    np.testing.assert_allclose(positions.max(axis=0), [1, 1, 1], atol=0.08)
    np.testing.assert_allclose(positions[:, :2].mean(axis=0), 0, atol=0.1)


def test_smaller_images_show_the_same_view():
    large = RandomViewpoints().sample(np.random.default_rng(0))
    small = RandomViewpoints(width=160, height=120).sample(np.random.default_rng(0))
    np.testing.assert_array_equal(small.T_world_camera, large.T_world_camera)
    assert (small.width, small.height) == (160, 120)
    assert small.fx == pytest.approx(579.4 / 4)
    assert small.cx == pytest.approx(79.5)


def test_no_jitter_looks_straight_at_the_centre():
    camera = RandomViewpoints(jitter=0, centre=(0.1, 0, 0.2)).sample(np.random.default_rng(3))
    seen = camera.T_world_camera[:3, :3].T @ (
        np.array([0.1, 0, 0.2]) - camera.T_world_camera[:3, 3]
    )
    np.testing.assert_allclose(seen[:2], 0, atol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"width": 0}, "image 0 x 480"),
        ({"heights": (1.0, 0.1)}, "heights"),
        ({"radius": -1}, "radius"),
        ({"closest": 2.0}, "closest"),
    ],
)
def test_bad_settings(wrong, message):
    with pytest.raises(ConfigError, match=message):
        RandomViewpoints(**wrong)
