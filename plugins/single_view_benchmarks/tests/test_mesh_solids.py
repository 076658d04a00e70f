"""Solids from a folder of meshes: units, what is left out, and one line for what is wrong."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from tests.unit.data import damaged

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import TriangleMesh
from scenefw.shapes.convex_parts import ConvexParts
from scenefw_single_view_benchmarks.mesh_solids import MeshSolids
from scenefw_single_view_benchmarks.part_cache import PartCache

SIDES = np.array([0.12, 0.08, 0.05])


@pytest.fixture
def folder(tmp_path):
    trimesh.creation.box(SIDES).export(tmp_path / "box.ply")
    (tmp_path / "round").mkdir()
    trimesh.creation.icosphere(radius=0.04).export(tmp_path / "round" / "ball.obj")
    return tmp_path


def test_meshes_are_solids_in_metres(folder):
    trimesh.creation.box([0.5, 0.1, 0.1]).export(folder / "shelf.stl")
    source = MeshSolids(str(folder))
    box = source.solid("box")
    np.testing.assert_allclose(np.ptp(box.vertices, axis=0), SIDES, atol=1e-6)
    assert box.volume() == pytest.approx(SIDES.prod(), rel=1e-5)
    np.testing.assert_array_equal(box.vertices, box.vertices.astype(np.float32))
    assert source.solid("shelf") is None  # longer than 0.3 m
    rng = np.random.default_rng(0)
    assert {source.sample(rng, "test").name for _ in range(30)} == {"box", "round/ball"}


def test_patterns_choose_files(folder):
    rng = np.random.default_rng(0)
    for settings in ({"names": ["ball"]}, {"leave_out": "^box$"}):
        found = {MeshSolids(str(folder), **settings).sample(rng, "test").name for _ in range(9)}
        assert found == {"round/ball"}


def test_millimetres_are_told_and_taken(folder):
    trimesh.creation.box(1000 * SIDES).export(folder / "box.ply")
    with pytest.raises(InputError, match=r"box\.ply would be 120 m long.*shape\.scale=0\.001"):
        MeshSolids(str(folder)).solid("box")
    box = MeshSolids(str(folder), scale=0.001).solid("box")
    np.testing.assert_allclose(np.ptp(box.vertices, axis=0), SIDES, atol=1e-6)


def test_a_scale_that_is_too_small_is_told_the_larger_one(folder):
    """A mesh in metres, and the scale of millimetres: the way back, not once more."""
    with pytest.raises(InputError, match=r"with shape\.scale=0\.001; .*maybe shape\.scale=1, or"):
        MeshSolids(str(folder), scale=0.001).solid("box")


def test_faces_that_look_inwards_are_turned(folder):
    mesh = trimesh.creation.box(SIDES)
    mesh.invert()
    mesh.export(folder / "box.ply")
    assert MeshSolids(str(folder)).solid("box").volume() > 0


@pytest.mark.parametrize(
    ("name", "words"), [("open", "is not closed"), ("empty", "empty.obj"), ("damaged", "damaged")]
)
def test_an_unusable_mesh_ends_in_one_line(folder, name, words):
    spoil(folder, name)
    with pytest.raises(InputError, match=words) as caught:
        MeshSolids(str(folder)).solid(name)
    assert f"shape.leave_out={name}" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_one_line_names_all_unusable_meshes_and_takes_them_out(folder):
    names = ("open", "empty", "damaged")
    for name in names:
        spoil(folder, name)
    with pytest.raises(InputError, match="3 of") as caught:
        MeshSolids(str(folder)).solid("open")
    pattern = re.search(r'shape\.leave_out="(.*)"', str(caught.value))[1]
    source = MeshSolids(str(folder), leave_out=pattern)
    drawn = {source.sample(np.random.default_rng(seed), "test").name for seed in range(20)}
    assert drawn == {"box", "round/ball"}
    with pytest.raises(InputError, match="3 of") as caught:
        MeshSolids(str(folder), leave_out="box").solid("open")
    assert 'leave_out="box|' in str(caught.value)


def spoil(folder, name):
    """Puts a mesh into the folder that can't be stacked."""
    if name == "open":
        mesh = trimesh.creation.box(SIDES)
        trimesh.Trimesh(mesh.vertices, mesh.faces[1:]).export(folder / "open.ply")
    elif name == "empty":
        (folder / "empty.obj").write_text("")
    else:
        (folder / "damaged.ply").write_bytes(b"ply\nformat")


def test_settings_that_cannot_be_meant(folder):
    with pytest.raises(ConfigError, match=r"shape\.root=FOLDER"):
        MeshSolids(None)
    with pytest.raises(InputError, match="there is no folder"):
        MeshSolids(str(folder / "nowhere"))
    with pytest.raises(InputError, match="holds no mesh"):
        MeshSolids(str(folder), names=["cup"])
    with pytest.raises(ConfigError, match=r"scene\.split=test"):
        MeshSolids(str(folder)).sample(np.random.default_rng(0), "train")
    with pytest.raises(InputError, match="no mesh in"):
        MeshSolids(str(folder), longest=0.04).sample(np.random.default_rng(0), "test")


def test_parts_are_found_once(tmp_path, monkeypatch):
    calls = []

    def found(self, mesh):
        calls.append(mesh)
        return (mesh.vertices, mesh.vertices + 1)

    monkeypatch.setattr(ConvexParts, "of", found)
    mesh = TriangleMesh(np.random.default_rng(0).random((4, 3)), np.array([[0, 1, 2]]))
    cache = PartCache(ConvexParts(), tmp_path)
    first, again = cache.of(mesh), cache.of(mesh)
    assert len(calls) == 1
    np.testing.assert_array_equal(first, again)
    PartCache(ConvexParts(threshold=0.5), tmp_path).of(mesh)
    assert len(calls) == 2


@pytest.mark.parametrize("kind", damaged.KINDS)
def test_damaged_parts_are_found_anew(tmp_path, kind):
    corners = np.random.default_rng(0).random((4, 3))
    cache = PartCache(ConvexParts(), tmp_path)
    cache.parts = SimpleNamespace(of=lambda mesh: (corners,))
    mesh = TriangleMesh(corners, np.array([[0, 1, 2]]))
    first = cache.of(mesh)
    (path,) = tmp_path.glob("*.npz")
    damaged.write(path, kind, {"part_000": corners})
    np.testing.assert_array_equal(cache.of(mesh), first)
