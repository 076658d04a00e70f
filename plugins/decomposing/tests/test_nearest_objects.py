"""Points and the objects whose surface is nearest."""

import numpy as np
import pytest
import trimesh

from scenefw.core.types import TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects
from scenefw_decomposing.nearest_objects import explained_shares, nearest_objects


def box(size, place):
    made = trimesh.creation.box(size)
    return TriangleMesh(made.vertices + place, np.asarray(made.faces, np.int64))


OBJECTS = estimate_objects(
    {3: box((0.1, 0.1, 0.1), (0.0, 0.0, 0.05)), 5: box((0.2, 0.1, 0.1), (0.2, 0.0, 0.05))}, {}
)


def test_points_are_of_the_nearest_surface_within_reach():
    points = np.array(
        [[0.0, 0.0, 0.104], [0.07, 0.0, 0.05], [0.085, 0.0, 0.05], [0.2, 0.07, 0.05], [1, 1, 1]]
    )
    labels, distances = nearest_objects(points, OBJECTS, 0.021)
    assert labels.tolist() == [3, 3, 5, 5, 0]
    np.testing.assert_allclose(distances[:4], [0.004, 0.02, 0.015, 0.02], atol=1e-9)
    assert np.isinf(distances[4])


def to_box(points, size, place):
    """Distance (N,) to the surface of a box, by its formula."""
    away = np.abs(points - place) - np.asarray(size) / 2
    outside = np.linalg.norm(away.clip(min=0), axis=1)
    return np.abs(outside + away.max(axis=1).clip(max=0))


def test_distances_are_those_of_boxes():
    points = np.random.default_rng(0).uniform((-0.1, -0.1, 0), (0.4, 0.1, 0.15), (200, 3))
    labels, distances = nearest_objects(points, OBJECTS, 1.0)
    first = to_box(points, (0.1, 0.1, 0.1), (0.0, 0.0, 0.05))
    second = to_box(points, (0.2, 0.1, 0.1), (0.2, 0.0, 0.05))
    np.testing.assert_allclose(distances, np.minimum(first, second), atol=1e-6)
    clear = np.abs(first - second) > 1e-5
    assert (labels == np.where(first < second, 3, 5))[clear].all()


def test_shares_of_explained_points():
    top = np.array([[0.0, 0.0, 0.101], [0.01, 0.0, 0.1], [0.0, 0.0, 0.115], [0.2, 0.0, 0.112]])
    assert explained_shares(top, OBJECTS, 0.006, 0.02) == {3: pytest.approx(2 / 3), 5: 0.0}
    assert explained_shares(np.zeros((0, 3)), OBJECTS, 0.006, 0.02) == {3: 0.0, 5: 0.0}
    assert nearest_objects(top, (), 0.02)[0].tolist() == [0, 0, 0, 0]
