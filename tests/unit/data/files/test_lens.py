"""Distorted images of a plane become those of a pinhole camera."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import fsolve

from scenefw.core.errors import InputError
from scenefw.data.files.lens import BROWN, FISHEYE, Lens, lens_of, undistorted

K = np.array([[100.0, 0, 79.5], [0, 100, 59.5], [0, 0, 1]])
SHAPE = (120, 160)
AZURE = (0.55, -2.2, 0.0006, -0.0002, 1.3, 0.43, -2.0, 1.25)  # rational, of a colour camera
SENSOR = (0.08, -0.05, 0.001, -0.001, 0.02)


def plane(x, y):
    """Depth of a tilted plane along rays x, y."""
    return 1.0 / (1 + 0.3 * x - 0.2 * y)


def rays():
    v, u = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return (u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1]


def distorted_plane(lens):
    """What a camera with the lens sees: of each pixel the ray is solved for, as OpenCV does."""
    x, y = rays()

    def error(p):
        a, b = lens.distorted(*p.reshape(-1, 2).T)
        return np.stack([a - px, b - py], axis=1).ravel()

    columns = []
    for px, py in zip(x.T, y.T, strict=True):
        column = fsolve(error, np.stack([px, py], axis=1).ravel(), band=(1, 1))
        columns.append(column.reshape(-1, 2).T)
    solved = np.stack(columns, axis=-1)
    return plane(solved[0], solved[1]).astype(np.float32)


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("plumb_bob", SENSOR),
        ("rational_polynomial", AZURE),
        ("equidistant", (0.01, -0.02, 0.005, 0.0)),
    ],
)
def test_a_plane_is_a_plane_again(model, coefficients):
    lens = lens_of(model, coefficients, "a")
    seen = distorted_plane(lens)
    [depth] = undistorted(lens, K, [seen], "a")
    expected = plane(*rays())
    measured = depth > 0
    assert measured.mean() > 0.8
    errors = np.abs(depth - expected)[measured]
    assert np.percentile(errors, 99) < 0.006  # half a pixel on the plane
    assert errors.max() < 0.5 * np.abs(seen - expected).max()


def test_opencv_publishes_this_formula():
    """k1 k2 p1 p2 k3 k4 k5 k6, one ray by hand."""
    k1, k2, p1, p2, k3, k4, k5, k6 = AZURE
    x, y = 0.3, -0.2
    r = x * x + y * y
    radial = (1 + k1 * r + k2 * r**2 + k3 * r**3) / (1 + k4 * r + k5 * r**2 + k6 * r**3)
    a, b = Lens(BROWN, AZURE).distorted(np.array([x]), np.array([y]))
    assert a[0] == pytest.approx(x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x))
    assert b[0] == pytest.approx(y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y)


@given(angle=st.floats(0.01, 1.2))
def test_an_ideal_fisheye_is_the_angle(angle):
    x, y = Lens(FISHEYE, (0.0,) * 4).distorted(np.array([0.0]), np.array([np.tan(angle)]))
    assert (x[0], y[0]) == pytest.approx((0.0, angle))


def test_colour_and_labels_follow_depth():
    lens = lens_of("plumb_bob", SENSOR, "a")
    ids = (np.arange(SHAPE[1]) // 20 + np.zeros(SHAPE, int)).astype(np.int32)
    colour = np.repeat(ids.astype(np.uint8)[..., None] * 30, 3, axis=2)
    depth, labels, moved = undistorted(lens, K, [np.ones(SHAPE, np.float32), ids, colour], "a")
    seen = depth > 0
    assert set(np.unique(labels)) <= set(range(8))
    assert np.abs(moved[..., 0] / 30 - labels)[seen].max() <= 1


@pytest.mark.parametrize("coefficients", [[], [0.0] * 5, [0.0] * 8, None])
def test_no_distortion_is_no_lens(coefficients):
    assert lens_of("plumb_bob", [] if coefficients is None else coefficients, "a") is None


@pytest.mark.parametrize(
    ("model", "coefficients", "said"),
    [
        ("plumb_bob", ["x"], "holds no numbers"),
        ("plumb_bob", [np.nan], "finite numbers"),
        ("distortion.inverse_brown_conrady", [0.1], "of an unknown model"),
        ("thin_prism", [0.1] * 12, "of an unknown model"),
    ],
)
def test_unknown_lenses_are_one_line(model, coefficients, said):
    with pytest.raises(InputError, match=said) as caught:
        lens_of(model, coefficients, "a.yaml")
    assert "a.yaml" in str(caught.value)


def test_a_strong_lens_is_refused():
    wide = np.array([[40.0, 0, 79.5], [0, 40, 59.5], [0, 0, 1]])
    with pytest.raises(InputError, match=r"the lens of a is too strong .* narrower view"):
        undistorted(Lens(FISHEYE, (0.0,) * 4), wide, [np.ones(SHAPE, np.float32)], "a")
