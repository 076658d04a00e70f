import numpy as np
import open3d
import pytest
import trimesh
from tests.unit.perception.edited_scenes import box

from scenefw.core.types import GridSpec, TriangleMesh
from scenefw.perception.evidence.mesh_distances import MeshDistances, mesh_volumes


def to_box(points, half):
    """Exact signed distance to a box about the origin (Quilez)."""
    q = np.abs(points) - half
    outside = np.linalg.norm(np.maximum(q, 0), axis=-1)
    return outside + np.minimum(q.max(axis=-1), 0)


def test_distances_to_a_box_of_twelve_triangles_are_exact():
    half = np.array([0.1, 0.06, 0.03])
    points = np.random.default_rng(0).uniform(-0.18, 0.18, (4000, 3))
    found = MeshDistances(box(2 * half, 0.0)).at(points)
    np.testing.assert_allclose(found, to_box(points, half), atol=1e-6)


def test_distances_are_cut_beyond_a_limit_alone():
    half = np.array([0.1, 0.06, 0.03])
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (4000, 3))
    distances = MeshDistances(box(2 * half, 0.0)).at(points, limit=0.02)
    exact = to_box(points, half)
    near = np.abs(exact) < 0.02
    np.testing.assert_allclose(distances[near], exact[near], atol=1e-6)
    assert (np.abs(distances[~near]) >= 0.02 - 1e-6).all()
    assert (np.sign(distances) == np.sign(exact)).all()


@pytest.mark.parametrize("sections", [8, 40])
def test_distances_to_a_ring_are_those_of_another_library(sections):
    torus = trimesh.creation.torus(0.1, 0.03, major_sections=sections, minor_sections=sections)
    mesh = TriangleMesh(np.array(torus.vertices), np.array(torus.faces))
    points = np.random.default_rng(2).uniform(-0.2, 0.2, (2000, 3))
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(np.float32(mesh.vertices), np.uint32(mesh.faces))
    expected = scene.compute_signed_distance(np.float32(points)).numpy()
    np.testing.assert_allclose(MeshDistances(mesh).at(points), expected, atol=1e-5)


def test_a_hollow_is_outside():
    torus = trimesh.creation.torus(0.1, 0.03, major_sections=48, minor_sections=24)
    ring = MeshDistances(TriangleMesh(np.array(torus.vertices), np.array(torus.faces)))
    angles = np.linspace(0, 6, 30)
    core = np.stack([0.1 * np.cos(angles), 0.1 * np.sin(angles), 0 * angles], axis=-1)
    assert ring.inside(core).all()
    assert not ring.inside(0.2 * core).any()
    np.testing.assert_allclose(ring.at(core), -0.03, atol=1e-3)
    np.testing.assert_allclose(ring.at(np.zeros((1, 3))), 0.07, atol=1e-3)


def test_heights_over_the_floor():
    solid = MeshDistances(box((0.2, 0.1, 0.04), (0.3, 0, 0.1)))
    places = np.array([[0.3, 0.0], [0.21, 0.049], [0.0, 0.0]])
    np.testing.assert_allclose(solid.lowest(places), [0.08, 0.08, np.nan], atol=1e-6)
    np.testing.assert_allclose(solid.highest(places), [0.12, 0.12, np.nan], atol=1e-6)


def test_volumes_of_two_boxes():
    grid = GridSpec(resolution=32)
    shapes = {4: ((0.2, 0.2, 0.1), (0.0, 0.0, 0.05)), 7: ((0.1, 0.1, 0.1), (0.2, 0.0, 0.05))}
    meshes = [(label, box(*shape)) for label, shape in shapes.items()]
    tsdf, instances = mesh_volumes(meshes, grid)
    points = grid.centres()
    true = {
        i: to_box(points - np.array(at), np.array(size) / 2) for i, (size, at) in shapes.items()
    }
    nearest = np.minimum(true[4], true[7])
    np.testing.assert_allclose(tsdf, np.clip(nearest, -grid.truncation, grid.truncation), atol=1e-5)
    for label in shapes:
        clear = (true[label] < -1e-6) & (true[label] < true[11 - label])
        assert (instances[clear] == label).all()
    assert (instances[nearest > 1e-6] == 0).all()
