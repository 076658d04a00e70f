import numpy as np
import pytest

from scenefw.core.errors import ConfigError, EmptyImageError, InputError
from scenefw.data.files.image_checks import Stored, check_depth, metres, placeholders


def test_depth_is_cleaned():
    depth = np.full((4, 5), 0.7)
    depth[0] = (np.nan, np.inf, -np.inf, -1, 0)
    clean = check_depth(depth, "x")
    assert (clean[0] == 0).all()
    assert (clean[1:] == np.float32(0.7)).all()


@pytest.mark.parametrize(
    ("depth", "words"),
    [
        (np.zeros((4, 5)), "no measurement"),
        (np.full((4, 5), np.nan), "no measurement"),
        (np.full((4, 5), 800.0), "millimetres given as metres"),
        (np.full((4, 5), 0.0008), "metres given as millimetres"),
        (np.ones((1, 4, 5)), r"shape \(1, 4, 5\)"),
        (np.ones(20), r"shape \(20,\)"),
    ],
)
def test_bad_depth_is_one_line(depth, words):
    with pytest.raises(InputError, match=words) as error:
        check_depth(depth, "view")
    assert "view" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("median", "stored", "words"),
    [
        (
            800,
            Stored(),
            r"millimetres given as metres\? depth in floats is in metres; multiply it by 0.001$",
        ),
        (8000, Stored(), "8000 m: tenths of millimetres given as metres"),
        (8e5, Stored(), "800000 m: micrometres given as metres"),
        (800, Stored(1e-3, "depth_mm"), r"micrometres given as millimetres\? depth_mm is in milli"),
        (800, Stored(1e-3, None), r"micrometres given as millimetres\? give .*depth_scale=1e-06$"),
        (800, Stored(1.0, None), r"millimetres given as metres\? give run.depth_scale=0.001$"),
        (2000, Stored(0.0002, None), r"given as units of 0.0002 m\? give run.depth_scale="),
        (1e30, Stored(1.0, None), r"1e\+30 m; give run.depth_scale=METRES_PER_UNIT$"),
        (1e30, Stored(), r"1e\+30 m; depth in floats is in metres; store it so$"),
    ],
)
def test_a_wrong_unit_is_named_with_a_remedy_that_the_depth_takes(median, stored, words):
    with pytest.raises(InputError, match=words):
        check_depth(np.full((4, 5), median, float), "view", stored)


def test_messages_say_what_pixels_hold():
    depth = np.zeros((3, 4))
    depth[0] = -1.0
    depth[1, :2], depth[1, 2:] = np.inf, np.nan
    with pytest.raises(EmptyImageError, match="of 12 pixels 4 0, 2 NaN, 2 infinite, 4 negative"):
        check_depth(depth, "view")


def test_whole_numbers_are_scaled_and_floats_are_not():
    whole, floats = np.array([[600, 700]], np.uint16), np.array([[0.6, 0.7]])
    np.testing.assert_allclose(metres(whole, None, "view"), floats, rtol=1e-6)
    np.testing.assert_allclose(metres(whole, None, "view", unit=0.01), floats * 10, rtol=1e-6)
    np.testing.assert_allclose(metres(whole, 0.1, "view", unit=0.01), floats * 100, rtol=1e-6)
    np.testing.assert_allclose(metres(floats, None, "view", unit=0.01), floats, rtol=1e-6)


def test_a_scale_that_changes_nothing_is_refused():
    said = "^depth_scale = 0.001 changes nothing for view: depth in floats is in metres; leave it"
    with pytest.raises(InputError, match=said):
        metres(np.ones((2, 2)), 0.001, "view")


@pytest.mark.parametrize("scale", [0, -0.001, float("nan")])
def test_a_scale_is_positive(scale):
    with pytest.raises(ConfigError, match=f"^depth_scale = {scale}: expected metres per unit"):
        metres(np.ones((2, 2), int), scale, "view")


def test_a_row_of_a_floor_at_the_horizon_is_no_placeholder():
    """Without noise a level camera sees the same depth along a row, far beyond the next one."""
    depth = np.repeat(1 / np.arange(1, 49, dtype=np.float32)[:, None], 64, axis=1)
    assert placeholders(depth) == []
    depth[5:7, 10:40] = 65.535
    assert placeholders(depth) == [pytest.approx(65.535)]
