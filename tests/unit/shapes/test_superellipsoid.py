"""Superellipsoids against trimesh, eq. 5.3 and superquadrics."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import InputError
from scenefw.core.types import Shape
from scenefw.shapes.superellipsoid import Superellipsoid
from scenefw.shapes.superquadric import Superquadric

AXES = [0.1, 0.05, 0.08]


@given(st.floats(0.1, 1.9), st.floats(0.1, 1.9))
def test_points_of_the_explicit_form_have_value_one(e1, e2):
    mu, omega = np.meshgrid(np.linspace(-1.5, 1.5, 11), np.linspace(-3, 3, 21))

    def power(x, e):
        return np.sign(x) * np.abs(x) ** e

    points = np.stack(  # eq. 5.3
        [
            AXES[0] * power(np.cos(mu), e1) * power(np.cos(omega), e2),
            AXES[1] * power(np.cos(mu), e1) * power(np.sin(omega), e2),
            AXES[2] * power(np.sin(mu), e1),
        ],
        axis=-1,
    )
    np.testing.assert_allclose(Superellipsoid(AXES, e1, e2).value(points), 1, atol=1e-8)


@pytest.mark.parametrize(("e1", "e2"), [(1.0, 1.0), (0.1, 1.0), (1.0, 0.2), (0.3, 1.6)])
def test_mesh_is_closed_and_has_the_volume(e1, e2):
    shape = Superellipsoid(AXES, e1, e2)
    assert isinstance(shape, Shape)
    found = shape.mesh(80)
    mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(shape.volume(), rel=5e-3)
    np.testing.assert_allclose(shape.value(found.vertices), 1, atol=1e-9)


def test_is_a_superquadric_where_both_parameters_are_equal():
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (100, 3))
    ours, other = Superellipsoid(AXES, 0.4, 0.4), Superquadric(AXES, np.full(3, 2 / 0.4))
    np.testing.assert_allclose(ours.value(points), other.value(points), rtol=1e-9)
    assert ours.volume() == pytest.approx(other.volume())


@pytest.mark.parametrize("wrong", [([0.1, 0.1], 1, 1), (AXES, 0, 1), (AXES, 1, 2.5)])
def test_bad_parameters(wrong):
    with pytest.raises(InputError, match="superellipsoid"):
        Superellipsoid(*wrong)
