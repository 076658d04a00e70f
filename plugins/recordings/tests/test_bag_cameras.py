"""Lenses and intrinsics of images in bags."""

import numpy as np
import pytest
from plugins.recordings.tests.bag_messages import (
    CAMERA,
    COLOUR,
    DEPTH,
    K,
    compressed,
    png_of,
    recording,
    written,
)

from scenefw.core.errors import InputError
from scenefw.data.files.lens import lens_of, undistorted
from scenefw_recordings.bags import Bag


def test_images_are_undistorted_by_their_camera_info(tmp_path):
    rational = [0.9, 0.02, 0.001, -0.001, 0.01, 0.2, 0.03, 0.0]
    messages = compressed("16UC1; png compressed", png_of(DEPTH), colour=True)
    messages[0] = (messages[0][0], 0, lambda s: s.info("rational_polynomial", rational))
    [frame] = Bag(written(tmp_path / "r", messages)).frames()
    _, note = frame.notes
    assert "undistorted by the coefficients D of /depth_registered/camera_info" in note
    lens = lens_of("rational_polynomial", rational, "r")
    depth, colour = undistorted(lens, K, [(DEPTH / 1000).astype(np.float32), COLOUR], "r")
    assert np.array_equal(frame.depth, depth)
    assert np.array_equal(frame.colour, colour)
    assert not np.allclose(frame.depth, DEPTH / 1000)


def test_rectified_images_have_the_intrinsics_of_their_projection(tmp_path):
    projection = np.hstack([K * [[0.9, 1, 1], [1, 0.9, 1], [1, 1, 1]], np.zeros((3, 1))])
    info = {"coefficients": [0.3, 0, 0, 0, 0], "projection": projection.ravel()}
    messages = [
        ("/depth/camera_info", 0, lambda s: s.info(**info)),
        ("/depth/image_rect_raw", 1, lambda s: s.image(DEPTH, "16UC1")),
    ]  # fmt: skip
    [frame] = Bag(written(tmp_path / "r", messages)).frames()
    assert np.allclose(frame.matrix, projection[:, :3])
    assert np.allclose(frame.depth, DEPTH / 1000)


FULL = K * [[2], [2], [1]]  # of images of 80 x 60 pixels


@pytest.mark.parametrize(
    ("info", "matrix"),
    [
        ({"matrix": FULL, "size": (80, 60), "binning": 2}, K),
        (
            {"matrix": FULL, "size": (80, 60), "region": (20, 15, 40, 30)},
            FULL - [[0, 0, 20], [0, 0, 15], [0, 0, 0]],
        ),
        (
            {
                "matrix": FULL * [[2], [2], [1]],
                "size": (160, 120),
                "region": (40, 30, 80, 60),
                "binning": 2,
            },
            FULL - [[0, 0, 20], [0, 0, 15], [0, 0, 0]],
        ),
        ({"size": (0, 0)}, K),
    ],
)
def test_intrinsics_are_those_of_the_region_and_of_binned_pixels(tmp_path, info, matrix):
    messages = recording()
    messages[0] = (messages[0][0], 0, lambda s: s.info(**info))
    [frame] = Bag(written(tmp_path / "r", messages)).frames(max_frames=1)
    np.testing.assert_allclose(frame.matrix, matrix)


@pytest.mark.parametrize(
    ("info", "said"),
    [
        (
            {"matrix": FULL, "size": (80, 60)},
            "has 40 x 30 pixels, but its intrinsics are of 80 x 60",
        ),
        ({"size": (80, 60), "binning": 4}, "its intrinsics are of 20 x 15"),
        ({"matrix": K * np.nan}, "fx = nan"),
        ({"matrix": K * 0}, "fx = 0"),
        ({"matrix": -K}, "fx = -60"),
    ],
)
def test_intrinsics_that_cannot_be_are_one_line(tmp_path, info, said):
    messages = recording()
    messages[0] = (messages[0][0], 0, lambda s: s.info(**info))
    with pytest.raises(
        InputError, match=rf"{said}.*{CAMERA}/camera_info: run\.info=TOPIC"
    ) as caught:
        list(Bag(written(tmp_path / "r", messages)).frames())
    assert "\n" not in str(caught.value)
