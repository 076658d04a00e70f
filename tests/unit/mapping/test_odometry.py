import sys
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.kernels import analytic
from tests.unit.mapping import tables

from scenefw.core.errors import ConfigError, InputError, MissingDependencyError
from scenefw.core.geometry import inverse
from scenefw.mapping.odometry import RGBDOdometry


def textured(view):
    """Boxes on a table whose colour is a smooth function of the place."""
    frame = tables.boxes(view)
    rays, eye = analytic.pixel_rays(view)
    x, y, z = np.moveaxis(eye + frame.depth[..., None] * rays, -1, 0)
    waves = np.stack(
        [np.sin(90 * x) + np.sin(70 * y), np.sin(80 * (x + y)) + z * 20, np.cos(60 * x)]
    )
    colour = np.moveaxis(np.clip(128 + 60 * waves, 0, 255), 0, -1).astype(np.uint8)
    return replace(frame, colour=colour)


def sequence(count=5):
    return [
        textured(tables.camera(0.004 * i, -0.003 * i, 0.3, 20 + i, 0.05 * i, width=160, rows=120))
        for i in range(count)
    ]


def test_poses_are_found_relative_to_the_first_camera():
    pytest.importorskip("open3d")
    frames = sequence()
    tracked = list(RGBDOdometry().track(frames))
    first = inverse(frames[0].camera.T_world_camera)
    np.testing.assert_array_equal(tracked[0].camera.T_world_camera, np.eye(4))
    for got, frame in zip(tracked, frames, strict=True):
        expected = first @ frame.camera.T_world_camera
        error = inverse(expected) @ got.camera.T_world_camera
        assert np.linalg.norm(error[:3, 3]) < 4e-3
        assert np.degrees(np.arccos(np.clip((np.trace(error[:3, :3]) - 1) / 2, -1, 1))) < 1.0
        np.testing.assert_array_equal(got.depth, frame.depth)
    moved = np.linalg.norm(expected[:3, 3])
    assert moved > 0.015


def test_lost_tracking_is_named():
    pytest.importorskip("open3d")
    frames = sequence(1)
    blind = replace(frames[0], depth=np.zeros_like(frames[0].depth), name="blind")
    with pytest.raises(InputError, match="lost at frame blind"):
        list(RGBDOdometry().track([*frames, blind]))


def test_mistakes_are_named():
    pytest.importorskip("open3d")
    frames = sequence(1)
    with pytest.raises(ConfigError, match="no method fast"):
        RGBDOdometry("fast")
    with pytest.raises(InputError, match="no colour"):
        list(RGBDOdometry().track([replace(frames[0], colour=None)]))
    small = textured(tables.camera(width=80, rows=60))
    with pytest.raises(InputError, match="same size"):
        list(RGBDOdometry().track([*frames, small]))


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(MissingDependencyError, match="pip install"):
        list(RGBDOdometry().track(sequence(1)))
