import numpy as np
import pytest
import trimesh

from scenefw.core.errors import InputError
from scenefw.core.types import TriangleMesh
from scenefw.metrics.sampling import face_areas, faces_of, sample_surface


def ball(radius=0.2):
    mesh = trimesh.creation.icosphere(4, radius)
    return TriangleMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64))


def test_areas_are_half_base_times_height():
    vertices = np.array([[0, 0, 0], [3, 0, 0], [0, 4, 0], [0, 0, 2]], dtype=float)
    faces = np.array([[0, 1, 2], [2, 0, 3]])
    np.testing.assert_allclose(face_areas(TriangleMesh(vertices, faces)), [6.0, 4.0])


def test_points_are_uniform_over_area_whatever_the_triangles():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.1, 0, 0]], dtype=float)
    faces = np.array([[0, 4, 3], [4, 1, 2], [4, 2, 3]])  # a unit square in uneven triangles
    drawn = sample_surface(TriangleMesh(vertices, faces), 40_000, np.random.default_rng(0))
    cells = np.histogram2d(*drawn.points[:, :2].T, bins=4, range=[[0, 1], [0, 1]])[0]
    assert np.abs(cells - 2500).max() < 5 * np.sqrt(2500)
    np.testing.assert_allclose(drawn.normals, np.tile([0, 0, 1.0], (40_000, 1)))


def test_points_lie_on_the_surface_with_outward_normals():
    drawn = sample_surface(ball(), 2000, np.random.default_rng(1))
    radii = np.linalg.norm(drawn.points, axis=1)
    assert radii.min() > 0.2 * 0.997
    assert radii.max() <= 0.2 + 1e-9
    cosines = (drawn.normals * drawn.points).sum(axis=1) / radii
    assert cosines.min() > 0.99


def test_same_seed_gives_same_points():
    first, second = (sample_surface(ball(), 50, np.random.default_rng(3)).points for _ in "ab")
    np.testing.assert_array_equal(first, second)


def test_chosen_faces_have_their_area():
    mesh = ball()
    chosen = mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0
    assert face_areas(faces_of(mesh, chosen)).sum() == pytest.approx(face_areas(mesh)[chosen].sum())


@pytest.mark.parametrize("faces", [np.zeros((0, 3), int), np.array([[0, 0, 1]])])
def test_a_mesh_without_area_is_named(faces):
    with pytest.raises(InputError, match="area"):
        sample_surface(TriangleMesh(np.zeros((2, 3)), faces), 5, np.random.default_rng(0))
