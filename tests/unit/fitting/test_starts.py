"""Boxes from which fits begin."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenefw.core.evidence import Evidence
from scenefw.fitting import superquadrics
from scenefw.fitting.starts import box_starts


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2])
def test_a_start_is_the_box_itself(angle):
    rng = np.random.default_rng(0)
    corners = rng.uniform(-1, 1, (4000, 3))
    corners[np.arange(4000), rng.integers(0, 3, 4000)] = rng.choice([-1, 1], 4000)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    points = (corners * (0.1, 0.05, 0.03)) @ turn.T + (0.2, -0.1, 0.03)
    pose, half_axes = box_starts(points)[0]
    np.testing.assert_allclose(pose.position, (0.2, -0.1, 0.03), atol=0.004)
    np.testing.assert_allclose(np.sort(half_axes), (0.03, 0.05, 0.1), rtol=0.12)
    for rotation in (one.rotation for one, _ in box_starts(points)):
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(rotation) == pytest.approx(1)


def test_points_on_a_line_are_no_crash():
    line = np.linspace(0, 1, 20)[:, None] * (0.1, 0.0, 0.0)
    starts = box_starts(line)
    assert starts
    assert all(np.isfinite(half_axes).all() for _, half_axes in starts)


def test_one_more_start_is_about_the_sure_points_alone():
    """A leaning slab, of which a wrong guess goes down to the floor."""
    slab = leaning_slab()
    guess = np.concatenate([slab, slab * (1, 1, 0.0), slab * (1, 1, 0.5)])
    boxes = box_starts(guess, slab)
    assert len(boxes) == len(box_starts(guess)) + 1 == len(box_starts(slab)) + 1
    thinnest = [half_axes.min() for _, half_axes in boxes]
    assert thinnest[-1] < 0.012 < min(thinnest[:-1])
    assert len(box_starts(slab, slab)) == 3  # all are sure


def test_fits_start_from_seen_points_too(monkeypatch):
    slab = leaning_slab()
    given = np.concatenate([slab, slab * (1, 1, 0.0)])
    asked = []
    monkeypatch.setattr(
        superquadrics, "box_starts", lambda *some: asked.append(some) or box_starts(*some)
    )
    superquadrics.SuperquadricFit().fit([Evidence(given, np.repeat([0.003, 0.3], len(slab)))])
    assert np.array_equal(asked[0][0], given)
    assert np.array_equal(asked[0][1], slab)


def leaning_slab(count=400):
    """Points of the upper and of one narrow side of a slab 2 cm thick."""
    rng = np.random.default_rng(1)
    local = rng.uniform(-1, 1, (count, 3)) * (0.12, 0.1, 0.01)
    side = np.arange(count) < count // 4
    local[~side, 2], local[side, 0] = 0.01, 0.12
    turn = Rotation.from_euler("xy", (25, 20), degrees=True).as_matrix()
    return local @ turn.T + (0.1, 0.0, 0.2)
