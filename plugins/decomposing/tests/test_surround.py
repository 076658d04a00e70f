"""Cameras on all sides: all of them see the whole of what they are placed around."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import ConfigError
from scenefw_decomposing.surround import SurroundingCameras

places = st.floats(-2, 2)


@given(st.tuples(places, places, places), st.floats(0.02, 1.0), st.integers(1, 8))
def test_every_camera_sees_the_sphere(centre, radius, ring):
    cameras = SurroundingCameras(ring=ring).around(centre, radius)
    assert len(cameras) == ring + 1
    angles = np.linspace(0, 2 * np.pi, 24)
    for camera in cameras:
        rotation, eye = camera.T_world_camera[:3, :3], camera.T_world_camera[:3, 3]
        # the outline of a sphere, a little outside of the great circle that faces the camera
        away = np.linalg.norm(eye - centre)
        outline = radius * np.sqrt(1 - (radius / away) ** 2)
        x, y = outline * np.cos(angles), outline * np.sin(angles)
        z = away - radius**2 / away
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        assert u.min() > 0
        assert u.max() < camera.width - 1
        assert v.min() > 0
        assert v.max() < camera.height - 1
        np.testing.assert_allclose(rotation.T @ (np.asarray(centre) - eye), [0, 0, away], atol=1e-9)
        assert eye[2] > centre[2]


def test_they_come_no_nearer_than_they_may_and_stand_apart():
    cameras = SurroundingCameras(nearest=0.9).around((0, 0, 0), 0.01)
    eyes = np.array([camera.T_world_camera[:3, 3] for camera in cameras])
    np.testing.assert_allclose(np.linalg.norm(eyes, axis=1), 0.9)
    apart = np.linalg.norm(eyes[:, None] - eyes[None], axis=-1) + 9 * np.eye(len(eyes))
    assert apart.min() > 0.7
    assert np.degrees(np.arcsin(eyes[-1, 2] / 0.9)) == pytest.approx(85)


@pytest.mark.parametrize("wrong", [{"ring": 0}, {"nearest": 0.0}, {"elevation": 90.0}])
def test_settings_out_of_range(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        SurroundingCameras(**wrong)
