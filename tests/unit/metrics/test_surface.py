import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from scenefw.core.errors import InputError
from scenefw.metrics.sampling import SurfacePoints
from scenefw.metrics.surface import chamfer, f_score, nearest, normal_consistency


def expected_floor(area, count):
    """Chamfer distance of two samplings of one surface (the mean nearest-neighbour distance)."""
    return np.sqrt(area / count)


clouds = st.integers(1, 12).flatmap(
    lambda n: arrays.arrays(np.float64, (n, 3), elements=st.floats(-1, 1, width=32))
)


def on_sphere(count, radius, rng):
    points = rng.normal(size=(count, 3))
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    return SurfacePoints(radius * normals, normals)


@given(clouds, clouds)
def test_equals_brute_force_and_is_symmetric(first, second):
    distances = np.linalg.norm(first[:, None] - second[None], axis=2)
    expected = distances.min(axis=1).mean() + distances.min(axis=0).mean()
    assert chamfer(first, second) == pytest.approx(expected)
    assert chamfer(second, first) == pytest.approx(expected)


@given(clouds, clouds, st.integers(0, 5))
def test_order_of_points_does_not_matter(first, second, seed):
    shuffled = np.random.default_rng(seed).permutation(first)
    assert chamfer(shuffled, second) == pytest.approx(chamfer(first, second))


@pytest.mark.parametrize(("radius", "count"), [(0.212, 1000), (0.212, 4000), (0.1, 1000)])
def test_two_samplings_of_a_sphere_are_the_expected_floor_apart(radius, count):
    rng = np.random.default_rng(0)
    found = [
        chamfer(on_sphere(count, radius, rng).points, on_sphere(count, radius, rng).points)
        for _ in range(5)
    ]
    assert np.mean(found) == pytest.approx(expected_floor(4 * np.pi * radius**2, count), rel=0.03)


def test_the_floor_of_the_thesis_s_surfaces_is_most_of_its_distance():
    assert expected_floor(0.565, 1000) == pytest.approx(0.0238, abs=1e-4)


def test_concentric_spheres_are_twice_their_distance_apart():
    rng = np.random.default_rng(1)
    inner, outer = on_sphere(30000, 0.10, rng), on_sphere(30000, 0.13, rng)
    assert chamfer(inner.points, outer.points) == pytest.approx(0.06, rel=0.01)
    found = nearest(inner.points, outer.points)
    assert f_score(found, 0.029) == 0.0
    assert f_score(found, 0.035) == 1.0
    assert normal_consistency(inner, outer, found) > 0.999


def test_f_score_is_the_harmonic_mean_of_precision_and_recall():
    predicted = np.array([[0, 0, 0], [5, 0, 0.0]])
    true = np.array([[0, 0, 0.1], [0, 0, 2], [0, 0, 3], [0, 0, 4.0]])
    assert f_score(nearest(predicted, true), 0.2) == pytest.approx(2 * 0.5 * 0.25 / 0.75)


def test_turned_normals_are_opposite():
    points = on_sphere(100, 1.0, np.random.default_rng(2))
    turned = SurfacePoints(points.points, -points.normals)
    found = nearest(points.points, turned.points)
    assert normal_consistency(points, turned, found) == pytest.approx(-1)


@pytest.mark.parametrize("bad", [np.zeros((0, 3)), np.zeros(3), np.zeros((4, 2))])
def test_bad_points_are_named(bad):
    with pytest.raises(InputError, match="predicted"):
        chamfer(bad, np.zeros((1, 3)))
