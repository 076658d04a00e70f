"""Solids that are not convex: in both engines things find room in their hollows."""

import numpy as np
import pytest

from scenefw.core.types import Pose, SceneObject, TriangleMesh
from scenefw.registry import build
from scenefw.shapes.hulls import collision_hulls
from scenefw.shapes.solid_mesh import SolidMesh, solid
from scenefw.shapes.superquadric import Superquadric

SIZE, WALL = 0.1, 0.02  # half width of the tray, its thickness (m)


def box(low, high):
    cube = Superquadric([1, 1, 1], [2, 2, 2]).mesh(1)
    low, high = np.array(low, float), np.array(high, float)
    return TriangleMesh(low + (np.sign(cube.vertices) + 1) / 2 * (high - low), cube.faces)


def tray():
    """An open box: a bottom and four walls."""
    s, w = SIZE, WALL
    boxes = [
        box([-s, -s, 0], [s, s, w]),
        box([-s, -s, w], [-s + w, s, s]), box([s - w, -s, w], [s, s, s]),
        box([-s + w, -s, w], [s - w, -s + w, s]), box([-s + w, s - w, w], [s - w, s, s]),
    ]  # fmt: skip
    starts = np.cumsum([0, *(len(one.vertices) for one in boxes)])
    mesh = TriangleMesh(
        np.concatenate([one.vertices for one in boxes]),
        np.concatenate([one.faces + start for one, start in zip(boxes, starts, strict=False)]),
    )
    return mesh, [one.vertices for one in boxes]


def placed_tray(*, divided):
    mesh, parts = tray()
    found = solid(mesh)
    rotation = found.pose.rotation
    own = tuple((part - found.pose.position) @ rotation for part in parts) if divided else ()
    shape = SolidMesh(found.shape.vertices, found.shape.faces, own)
    return SceneObject(shape, found.pose, 500 * shape.volume())


@pytest.mark.parametrize("name", ["pybullet", "mujoco"])
def test_a_ball_falls_into_a_tray_but_not_into_its_hull(name):
    pytest.importorskip(name)
    ball = SceneObject(
        Superquadric([0.03] * 3, [2] * 3),
        Pose(np.array([0, 0, 0.2]), np.array([1.0, 0, 0, 0])),
        0.1,
    )
    heights = []
    for divided in (True, False):
        engine = build("engine", name)
        engine.reset()
        holder = engine.add(placed_tray(divided=divided))
        handle = engine.add(ball)
        engine.settle(1500)
        heights.append(engine.pose(handle).position[2])
        at = placed_tray(divided=divided).pose.position
        np.testing.assert_allclose(engine.pose(holder).position, at, atol=2e-3)
    assert heights == [pytest.approx(WALL + 0.03, abs=2e-3), pytest.approx(SIZE + 0.03, abs=2e-3)]


def test_moments_of_a_solid_are_those_of_its_boxes():
    shape = placed_tray(divided=True).shape
    s, w = SIZE, WALL
    assert shape.volume() == pytest.approx((2 * s) ** 2 * s - (2 * s - 2 * w) ** 2 * (s - w))
    whole = Superquadric([0.1, 0.05, 0.03], [2, 2, 2])
    ball = solid(whole.mesh(60)).shape
    np.testing.assert_allclose(ball.inertia(), whole.inertia(), rtol=5e-3)


def test_hulls_of_parts_are_drawn_in_by_the_margin():
    item = placed_tray(divided=True)
    margin, corners = 1e-3, np.concatenate(collision_hulls(item.shape, 5e-4, 1e-3))
    there = corners @ item.pose.rotation.T + item.pose.position
    np.testing.assert_allclose(
        there.min(axis=0), [-SIZE + margin, -SIZE + margin, margin], atol=1e-6
    )
    np.testing.assert_allclose(there.max(axis=0), [SIZE - margin] * 3, atol=1e-6)
