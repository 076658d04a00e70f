from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scenefw.core.errors import ConfigError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, Frame
from scenefw.labelling.network_inputs import distance_image, image_tensor

angles = st.floats(-np.pi, np.pi)


def frame_of_plane(eye, level, roll=0.0, size=(32, 24)):
    """A view of the plane z = level by an independent formula: rays cut with the plane.

    The camera is turned about its own axis by `roll` (radians), else its x axis is level.
    """
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("z", roll).as_matrix()
    camera = Camera().resized(*size).moved(look_at(eye, (0.05, -0.02, 0.0)) @ turn)
    v, u = np.mgrid[: size[1], : size[0]]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.matrix).T
    rays = rays @ camera.T_world_camera[:3, :3].T
    depth = (level - camera.T_world_camera[2, 3]) / rays[..., 2]
    return Frame(depth.astype(np.float32), camera)


@given(angles, st.floats(0.05, 0.3), st.floats(0.2, 0.5), st.floats(0, 0.1), angles)
def test_a_plane_has_its_height_everywhere(angle, radius, height, level, roll):
    eye = (radius * np.cos(angle), radius * np.sin(angle), height)
    frame = frame_of_plane(eye, level, roll)
    assume(0 < frame.depth.min() < frame.depth.max() < 5)  # no ray misses the plane
    found = distance_image(frame, "height")
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, level, atol=1e-6)


def test_depth_is_depth_and_what_is_missing_is_nan():
    frame = frame_of_plane((0.1, 0.1, 0.3), 0.0)
    depth = frame.depth.copy()
    depth[3, 4] = 0
    for geometry in ("depth", "height"):
        found = distance_image(replace(frame, depth=depth), geometry)
        assert np.isnan(found[3, 4])
        assert np.isfinite(found).sum() == found.size - 1
    np.testing.assert_array_equal(distance_image(frame), frame.depth)


def test_another_geometry_is_one_line():
    with pytest.raises(ConfigError, match="expected depth, height or plane_height"):
        distance_image(frame_of_plane((0.1, 0.1, 0.3), 0.0), "normals")


def test_an_image_as_networks_take_it():
    image = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    found = image_tensor(image)
    assert found.shape == (3, 4, 5)
    assert found[2, 3, 4] == pytest.approx(59 / 255)
