import numpy as np
import pytest
import trimesh

from scenefw.core.errors import StorageError
from scenefw.core.types import (
    Camera,
    Frame,
    GridSpec,
    ObjectEstimate,
    Pose,
    SceneEstimate,
    TriangleMesh,
)
from scenefw.export.meshes import write_glb, write_ply

COLOURS = [(1.0, 0.5, 0.0), (0.0, 0.2, 1.0)]


def mesh_at(*position):
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    return TriangleMesh(np.array(mesh.vertices) + position, np.array(mesh.faces))


def estimate_of(*meshes):
    grid = GridSpec(resolution=8)
    pose = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
    objects = tuple(
        ObjectEstimate(i + 1, mesh, pose, np.full(3, 0.2), 0.5) for i, mesh in enumerate(meshes)
    )
    frame = Frame(np.ones((4, 5), dtype=np.float32), Camera(width=5, height=4), name="x")
    volume = np.zeros(grid.shape)
    return SceneEstimate(
        objects, grid, volume.astype(np.float32), volume.astype(np.int32), frame, {}
    )


@pytest.mark.parametrize("colour", [None, COLOURS[0]])
def test_ply_round_trip(tmp_path, colour):
    mesh = mesh_at(0.1, 0.2, 0.3)
    write_ply(tmp_path / "a.ply", mesh, colour)
    read = trimesh.load(tmp_path / "a.ply", process=False)
    np.testing.assert_allclose(read.vertices, mesh.vertices, atol=1e-6)
    np.testing.assert_array_equal(read.faces, mesh.faces)
    assert read.is_watertight
    assert read.volume > 0
    if colour is not None:
        np.testing.assert_array_equal(read.visual.vertex_colors[:, :3], [[255, 128, 0]] * 162)


def test_spread_stands_beside_the_vertices(tmp_path):
    mesh, spread = mesh_at(0.1, 0.2, 0.3), np.linspace(0, 0.01, 162, dtype=np.float32)
    write_ply(tmp_path / "a.ply", mesh, COLOURS[0], spread)
    read = trimesh.load(tmp_path / "a.ply", process=False)
    np.testing.assert_array_equal(read.metadata["_ply_raw"]["vertex"]["data"]["spread"], spread)
    np.testing.assert_allclose(read.vertices, mesh.vertices, atol=1e-6)


def test_ply_of_no_triangles(tmp_path):
    write_ply(tmp_path / "a.ply", TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int)))
    assert b"element vertex 0\n" in (tmp_path / "a.ply").read_bytes()


def test_glb_has_a_node_per_object_with_y_up(tmp_path):
    meshes = mesh_at(0.1, 0.2, 0.6), mesh_at(-0.1, 0.2, 0.1)
    write_glb(tmp_path / "s.glb", estimate_of(*meshes), COLOURS)
    scene = trimesh.load(tmp_path / "s.glb")
    assert set(scene.graph.nodes_geometry) == {"object_01", "object_02"}
    for name, mesh, colour in zip(("object_01", "object_02"), meshes, COLOURS, strict=True):
        transform, geometry = scene.graph[name]
        x, y, z = mesh.vertices.mean(axis=0)
        found = trimesh.transform_points(scene.geometry[geometry].vertices, transform)
        np.testing.assert_allclose(found.mean(axis=0), (x, z, -y), atol=1e-6)
        factor = scene.geometry[geometry].visual.material.baseColorFactor
        np.testing.assert_allclose(factor[:3], np.rint(np.array(colour) * 255))


def test_glb_without_objects_is_valid(tmp_path):
    write_glb(tmp_path / "s.glb", estimate_of(), [])
    data = (tmp_path / "s.glb").read_bytes()
    assert data[:4] == b"glTF"
    assert int.from_bytes(data[8:12], "little") == len(data)
    assert len(trimesh.load(tmp_path / "s.glb", force="scene").geometry) == 0


def test_nothing_half_is_left(tmp_path, monkeypatch):
    (tmp_path / "a.ply").write_text("old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(StorageError, match="No space left"):
        write_ply(tmp_path / "a.ply", mesh_at(0, 0, 0))
    assert [path.name for path in tmp_path.iterdir()] == ["a.ply"]
    assert (tmp_path / "a.ply").read_text() == "old"
