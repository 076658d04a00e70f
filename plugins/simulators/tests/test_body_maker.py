"""Predicted objects as rigid bodies."""

import sys

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from scenefw.core.types import PlacedShape, Pose, TriangleMesh
from scenefw.shapes.convex_parts import ConvexParts, fills_hull
from scenefw.shapes.superquadric import Superquadric
from scenefw.shapes.vessel import Vessel
from scenefw_simulators.body_maker import BodyMaker

ALONG = Pose(np.array([0.2, -0.1, 0.3]), np.array([0.8, 0.6, 0, 0]))


def in_world(shape, pose=ALONG):
    return PlacedShape(shape, pose).mesh()


def elbow():
    """Three cubes in an L, as one closed mesh: it fills 6/7 of its hull."""
    corners = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]) * 0.05
    triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]])
    ring = [[i, (i + 1) % 6] for i in range(6)]
    sides = [f for a, b in ring for f in ([a, b, b + 6], [a, b + 6, a + 6])]
    vertices = np.vstack([np.column_stack([corners, np.full(6, z)]) for z in (0.0, 0.05)])
    return TriangleMesh(vertices, np.array([*triangles[:, ::-1], *(triangles + 6), *sides]))


def test_a_mesh_becomes_a_body_of_its_mass_about_its_centre():
    shape = Superquadric([0.08, 0.05, 0.03], [4, 4, 4])
    bodies = BodyMaker(200.0).make({3: in_world(shape)}, {}).bodies
    np.testing.assert_allclose(bodies[3].pose.position, ALONG.position, atol=1e-6)
    assert bodies[3].mass == pytest.approx(200 * shape.volume(), rel=0.01)
    back = PlacedShape(bodies[3].shape, bodies[3].pose).mesh()
    np.testing.assert_allclose(back.vertices, in_world(shape).vertices, atol=1e-9)


def test_a_shape_that_explains_an_object_is_taken_for_its_mesh():
    shape = Superquadric([0.08, 0.05, 0.03], [4, 4, 4])
    made = BodyMaker().make({1: elbow()}, {1: PlacedShape(shape, ALONG)})
    assert made.bodies[1].shape is shape
    assert made.collides_as(1) == "superquadric"


def test_a_vessel_collides_as_pieces_of_its_wall():
    vessel = Vessel(0.04, 1.0, 1.0, 0.1, 0.004)
    made = BodyMaker(300.0).make({1: elbow()}, {1: PlacedShape(vessel, ALONG)})
    assert made.divided(1)
    assert made.bodies[1].mass == pytest.approx(300 * vessel.volume())
    middle = np.zeros(3)  # of the hollow: in no piece
    hulls = [ConvexHull(part) for part in made.bodies[1].shape.parts]
    assert not any((h.equations @ [*middle, 1] < 0).all() for h in hulls)


def test_what_is_not_closed_or_flat_is_left_out_and_said():
    whole = in_world(Superquadric([0.05] * 3, [2] * 3))
    opened = TriangleMesh(whole.vertices, whole.faces[1:])
    flat = TriangleMesh(whole.vertices * [1, 1, 0], whole.faces)
    made = BodyMaker().make({1: opened, 2: flat, 3: whole}, {})
    assert made.left_out == {1: "its surface is not closed", 2: "it holds no volume"}
    assert list(made.bodies) == [3]


def test_an_elbow_is_divided_where_coacd_is_installed():
    pytest.importorskip("coacd", reason="needs coacd (pip install 'scenefw[parts]')")
    mesh = elbow()
    assert fills_hull(mesh) == pytest.approx(6 / 7)
    parts = ConvexParts(convex=0.9, threshold=0.05)
    made = BodyMaker(parts=parts).make({1: mesh}, {})
    assert made.divided(1)
    volumes = [ConvexHull(part).volume for part in made.bodies[1].shape.parts]
    assert sum(volumes) == pytest.approx(made.bodies[1].shape.volume(), rel=0.02)
    assert made.collides_as(1) == f"{len(volumes)} convex parts"
    assert not BodyMaker(parts=ConvexParts(convex=0.8)).make({1: mesh}, {}).divided(1)


def test_without_coacd_an_elbow_is_its_hull(monkeypatch):
    monkeypatch.setitem(sys.modules, "coacd", None)
    made = BodyMaker(parts=ConvexParts(convex=0.9)).make({1: elbow()}, {})
    assert made.collides_as(1) == "convex hull"
