"""Superquadrics against trimesh, scipy quadrature and the definition itself."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import beta

from scenefw.core.errors import InputError
from scenefw.core.types import Shape
from scenefw.shapes.superquadric import MAX_SAGITTA, Superquadric, support_points

axes = st.lists(st.floats(0.02, 0.2), min_size=3, max_size=3)
powers = st.lists(st.floats(1.0, 100.0), min_size=3, max_size=3)
vectors = st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(
    lambda v: np.hypot(*v[:2]) > 0.1
)


def as_trimesh(shape: Superquadric, resolution: int) -> trimesh.Trimesh:
    mesh = shape.mesh(resolution)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def test_is_a_shape():
    assert isinstance(Superquadric([0.1, 0.1, 0.1], [2, 2, 2]), Shape)


@given(axes, powers)
def test_mesh_is_closed_outward_and_on_the_surface(half_axes, exponents):
    shape = Superquadric(half_axes, exponents)
    mesh = as_trimesh(shape, 12)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    np.testing.assert_allclose(shape.value(mesh.vertices), 1, atol=1e-9)
    np.testing.assert_allclose(mesh.extents / 2, half_axes, rtol=1e-6)


@given(st.floats(0.005, 0.5))
def test_faces_of_a_ball_are_as_near_as_said(radius):
    mesh = Superquadric([radius] * 3, [2] * 3).mesh()
    edges = mesh.vertices[mesh.faces] + mesh.vertices[np.roll(mesh.faces, 1, axis=1)]
    sagitta = radius - np.linalg.norm(edges / 2, axis=-1).min()
    assert 0.5 * MAX_SAGITTA < sagitta <= MAX_SAGITTA


@pytest.mark.parametrize(
    "exponents", [(2, 2, 2), (2, 5, 40), (100, 100, 100), (1, 1, 1), (3, 3, 12)]
)
def test_volume_and_inertia_are_those_of_a_fine_mesh(exponents):
    shape = Superquadric([0.03, 0.08, 0.15], exponents)
    mesh = as_trimesh(shape, 96)
    assert shape.volume() == pytest.approx(mesh.volume, rel=2e-3)
    moments = np.diag(mesh.moment_inertia) / mesh.volume
    np.testing.assert_allclose(shape.inertia(), moments, rtol=4e-3)


def test_volume_is_the_beta_formula_of_superellipsoids():
    """V = 2 a1 a2 a3 e1 e2 B(e1/2 + 1, e1) B(e2/2, e2/2) (Jaklic et al. 2000)."""
    for e in (0.1, 0.4, 1.0):
        shape = Superquadric([0.1, 0.05, 0.02], np.full(3, 2 / e))
        expected = 2 * 0.1 * 0.05 * 0.02 * e * e * beta(e / 2 + 1, e) * beta(e / 2, e / 2)
        assert shape.volume() == pytest.approx(expected, rel=1e-9)


def test_superellipsoid_of_equal_exponents_has_the_same_surface():
    shape = Superquadric([0.1, 0.05, 0.02], np.full(3, 2 / 0.5))
    mu, omega = np.meshgrid(np.linspace(-1.5, 1.5, 21), np.linspace(-3, 3, 41))

    def power(x):
        return np.sign(x) * np.abs(x) ** 0.5

    points = np.stack(  # eq. 5.3
        [
            0.1 * power(np.cos(mu)) * power(np.cos(omega)),
            0.05 * power(np.cos(mu)) * power(np.sin(omega)),
            0.02 * power(np.sin(mu)),
        ],
        axis=-1,
    )
    np.testing.assert_allclose(shape.value(points), 1, atol=1e-9)


@given(axes, powers, vectors)
def test_support_is_the_furthest_point(half_axes, exponents, direction):
    shape = Superquadric(half_axes, exponents)
    point = shape.support(direction)
    assert shape.value(point) == pytest.approx(1, abs=5e-3)
    vertices = shape.mesh(40).vertices
    reach = point @ direction
    assert (vertices @ direction).max() <= reach + 1e-3 * max(half_axes)
    assert (vertices @ direction).max() >= 0.98 * reach


@given(axes, powers, vectors)
def test_project_lies_on_the_ray(half_axes, exponents, direction):
    shape = Superquadric(half_axes, exponents)
    point = shape.project(direction)
    assert shape.value(point) == pytest.approx(1, abs=1e-9)
    np.testing.assert_allclose(np.cross(point, direction), 0, atol=1e-9)
    assert point @ direction > 0
    assert shape.value(0.99 * point) < 1 < shape.value(1.01 * point)


def test_normals_match_numerical_gradients():
    shape = Superquadric([0.1, 0.06, 0.03], [2.5, 6.0, 3.0])
    points = shape.project(np.random.default_rng(0).normal(size=(50, 3)))
    step = 1e-7
    gradient = np.stack(
        [shape.value(points + step * e) - shape.value(points - step * e) for e in np.eye(3)],
        axis=-1,
    )
    gradient /= np.linalg.norm(gradient, axis=-1, keepdims=True)
    np.testing.assert_allclose(shape.normals(points), gradient, atol=1e-5)


def test_support_of_many_shapes_at_once():
    rng = np.random.default_rng(1)
    half_axes, exponents = rng.uniform(0.03, 0.1, (7, 3)), rng.uniform(2, 50, (7, 3))
    directions = rng.normal(size=(7, 3))
    together = support_points(half_axes, exponents, directions)
    for i in range(7):
        alone = Superquadric(half_axes[i], exponents[i]).support(directions[i])
        np.testing.assert_allclose(together[i], alone, atol=1e-12)


@pytest.mark.parametrize(
    ("half_axes", "exponents"),
    [
        ([0.1, 0.1], [2, 2, 2]),
        ([0.1, 0.1, 0.0], [2, 2, 2]),
        ([0.1, 0.1, np.nan], [2, 2, 2]),
        ([0.1, 0.1, 0.1], [2, 2, 0.5]),
    ],
)
def test_bad_parameters(half_axes, exponents):
    with pytest.raises(InputError, match="expected 3 finite numbers"):
        Superquadric(half_axes, exponents)


def test_parameters_cannot_be_changed():
    shape = Superquadric([0.1, 0.1, 0.1], [2, 2, 2])
    with pytest.raises(ValueError, match="read-only"):
        shape.half_axes[0] = 1
