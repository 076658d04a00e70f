"""Random viewpoints: where they stand, where they look, which image they make."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scenefw.core.errors import ConfigError
from scenefw.core.rng import Streams
from scenefw.scenes.cameras import RandomViewpoints


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


def features(poses):
    """Position, viewing direction and roll of poses (B, 4, 4), in columns."""
    poses = np.asarray(poses)
    return np.concatenate([poses[:, :3, 3], poses[:, :3, 2], poses[:, 2:3, 0]], axis=1)


@pytest.mark.parametrize("settings", [{}, {"closest": 0.5, "heights": (0.33, 0.83)}])
def test_poses_of_a_batch_are_distributed_as_single_cameras(settings):
    source = RandomViewpoints(**settings)
    rng = np.random.default_rng(0)
    single = features([source.sample(rng).T_world_camera for _ in range(1500)])
    batch = features(source.poses(Streams.of(0, indices=range(1500))))
    for one, many in zip(single.T, batch.T, strict=True):
        assert np.ptp(one) < 1e-9 or stats.ks_2samp(one, many).pvalue > 1e-3
    away = np.linalg.norm(batch[:, :3] - source.centre, axis=1)
    assert away.min() >= source.closest
    distances = np.linalg.norm(single[:, :3] - source.centre, axis=1)
    assert stats.ks_2samp(away, distances).pvalue > 1e-3


def test_a_pose_depends_on_its_own_stream_alone():
    source = RandomViewpoints()
    together = source.poses(Streams.of(0, indices=range(40)))
    for i in (0, 7, 39):
        alone = source.poses(Streams.of(0, indices=[i]))
        np.testing.assert_array_equal(alone[0], together[i])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"width": 0}, "width = 0"),
        ({"heights": (1.0, 0.1)}, "heights"),
        ({"radius": -1}, "radius"),
        ({"closest": 2.0}, "closest"),
    ],
)
def test_bad_settings(wrong, message):
    with pytest.raises(ConfigError, match=message):
        RandomViewpoints(**wrong)
