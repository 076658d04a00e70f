"""Collision hulls: grown by the margin they must be the shape again."""

import numpy as np
import pytest

from scenefw.core.types import TriangleMesh
from scenefw.shapes.hulls import collision_hull
from scenefw.shapes.superquadric import Superquadric
from scenefw_simulators.generation.library import SuperquadricLibrary

TOLERANCE, MARGIN = 1e-3, 1e-3


def directions(shape):
    random = np.random.default_rng(0).normal(size=(3000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    return np.concatenate([random, shape.normals(shape.project(random * shape.half_axes))])


@pytest.mark.parametrize("index", range(6))
def test_grown_hull_follows_the_shape(index):
    shape = SuperquadricLibrary(size=6)[index]
    normals = directions(shape)
    wanted = np.einsum("ij,ij->i", normals, shape.support(normals))
    got = (normals @ collision_hull(shape, TOLERANCE, MARGIN).T).max(axis=1) + MARGIN
    assert np.abs(got - wanted).max() < 1.2e-3


def test_flat_sides_are_exact():
    shape = Superquadric([0.1, 0.05, 0.08], [100, 60, 80])
    corners = collision_hull(shape, TOLERANCE, MARGIN)
    np.testing.assert_allclose(corners.max(axis=0) + MARGIN, shape.half_axes, atol=1e-7)
    np.testing.assert_allclose(corners.min(axis=0) - MARGIN, -shape.half_axes, atol=1e-7)


def test_boxes_need_few_corners_and_balls_more():
    box = collision_hull(Superquadric([0.1] * 3, [100] * 3), TOLERANCE, MARGIN)
    ball = collision_hull(Superquadric([0.1] * 3, [2] * 3), TOLERANCE, MARGIN)
    assert len(box) < 40 < len(ball) < 500


def test_other_shapes_are_eroded_by_the_margin():
    class Box:
        def mesh(self):
            cube = Superquadric([0.1, 0.1, 0.1], [2, 2, 2]).mesh(1)
            return TriangleMesh(np.sign(cube.vertices) * 0.1, cube.faces)

        def volume(self):
            return 8e-3

    corners = collision_hull(Box(), TOLERANCE, MARGIN)
    assert len(corners) == 8
    np.testing.assert_allclose(np.abs(corners), 0.099, atol=1e-9)
