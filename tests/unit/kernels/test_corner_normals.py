"""Normals of corners against closed forms and against sums over all faces."""

import numpy as np
import pytest
import trimesh

from scenefw.kernels.corner_normals import corner_normals

SMOOTH = float(np.cos(np.radians(35)))


@pytest.mark.parametrize(("subdivisions", "off"), [(2, 0.03), (3, 0.015)])
def test_a_ball_looks_round(subdivisions, off):
    ball = trimesh.creation.icosphere(subdivisions)
    found = corner_normals(ball.vertices, ball.faces, SMOOTH)
    np.testing.assert_allclose(found, ball.vertices[ball.faces], atol=off)


def test_a_box_has_edges():
    box = trimesh.creation.box((1, 2, 3))
    found = corner_normals(box.vertices, box.faces, SMOOTH)
    np.testing.assert_allclose(found, np.repeat(box.face_normals[:, None], 3, axis=1), atol=1e-12)


@pytest.mark.parametrize("degrees", [10, 35, 80])
def test_faces_count_by_their_area_if_they_meet_smoothly(degrees):
    """Brute force over pairs of faces that share a vertex."""
    mesh = trimesh.creation.icosphere(1)
    mesh.vertices = mesh.vertices * (1.0, 0.5, 0.2)
    smooth = np.cos(np.radians(degrees))
    found = corner_normals(mesh.vertices, mesh.faces, smooth)
    normals, areas = mesh.face_normals, mesh.area_faces
    for face, corners in enumerate(mesh.faces):
        for k, vertex in enumerate(corners):
            near = (mesh.faces == vertex).any(axis=1) & (normals @ normals[face] > smooth)
            expected = (areas[near, None] * normals[near]).sum(axis=0)
            np.testing.assert_allclose(
                found[face, k], expected / np.linalg.norm(expected), atol=1e-9
            )


def test_faces_without_area_do_no_harm():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]])
    found = corner_normals(vertices, np.array([[0, 1, 2], [0, 1, 3]]), SMOOTH)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[0], [[0, 0, 1]] * 3)
    assert corner_normals(np.zeros((0, 3)), np.zeros((0, 3), np.int64), SMOOTH).shape == (0, 3, 3)
