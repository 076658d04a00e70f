"""Meshes of scenes: z up and in metres from every format, or one clear line."""

import json
import os

import numpy as np
import pytest
import trimesh

from scenefw.core import geometry
from scenefw.core.errors import InputError
from scenefw_decomposing.scene_meshes import is_mesh, read_scene_mesh


def tall(path, factor=1.0, **export):
    """A box 10 x 20 x 30 cm, z up as the format says it."""
    box = trimesh.creation.box((0.1 * factor, 0.2 * factor, 0.3 * factor))
    if path.suffix in (".glb", ".gltf"):
        box.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    box.export(path, **export)
    return path


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".off", ".glb"])
def test_formats(tmp_path, suffix):
    file = tall(tmp_path / f"scene{suffix}")
    mesh, T = read_scene_mesh(file)  # noqa: N806
    raw = trimesh.load(file, force="mesh", process=False).vertices
    np.testing.assert_allclose(mesh.vertices, geometry.transform_points(T, raw), atol=1e-9)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [0.1, 0.2, 0.3], atol=1e-6)
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(0.006, rel=1e-5)  # not mirrored
    assert is_mesh(tmp_path / f"scene{suffix.upper()}")


def test_several_objects_of_a_file(tmp_path):
    scene = trimesh.Scene()
    for place in (0.0, 0.5):
        moved = trimesh.transformations.translation_matrix((place, 0, 0))
        scene.add_geometry(trimesh.creation.box((0.1, 0.1, 0.1)), transform=moved)
    scene.export(tmp_path / "two.glb")
    mesh, _ = read_scene_mesh(tmp_path / "two.glb")
    assert len(mesh.faces) == 24
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [0.6, 0.1, 0.1], atol=1e-6)


def test_units(tmp_path):
    file = tall(tmp_path / "mm.ply", 1000)
    with pytest.raises(InputError, match=r"300 m wide; .* run\.mesh_scale .*=0\.001"):
        read_scene_mesh(file)
    scaled, T = read_scene_mesh(file, 0.001)  # noqa: N806
    np.testing.assert_allclose(T, np.diag([0.001, 0.001, 0.001, 1.0]))
    np.testing.assert_allclose(np.ptp(scaled.vertices, axis=0), [0.1, 0.2, 0.3], atol=1e-6)
    with pytest.raises(InputError, match=r"only 0\.3 mm wide"):
        read_scene_mesh(tall(tmp_path / "km.ply", 0.001))


def test_unusable_files(tmp_path):
    with pytest.raises(InputError, match=r"no file .*none\.ply"):
        read_scene_mesh(tmp_path / "none.ply")
    for name in ("bad.ply", "bad.stl", "bad.glb", "bad.obj", "bad.off"):
        (tmp_path / name).write_bytes(b"hello\n")
        with pytest.raises(InputError, match=f"{name}"):
            read_scene_mesh(tmp_path / name)
    tall(tmp_path / "cut.stl")
    (tmp_path / "cut.stl").write_bytes((tmp_path / "cut.stl").read_bytes()[:-60])
    with pytest.raises(InputError, match=r"cut\.stl holds no mesh, or only the beginning of one"):
        read_scene_mesh(tmp_path / "cut.stl")
    for name, encoding in (("cut.off", {}), ("cut.ply", {"encoding": "ascii"})):
        tall(tmp_path / name, **encoding)
        lines = (tmp_path / name).read_text().splitlines()
        read_scene_mesh(tmp_path / name)
        (tmp_path / name).write_text("\n".join(lines[:-3]))
        with pytest.raises(InputError, match=f"{name} holds no mesh, or only the beginning"):
            read_scene_mesh(tmp_path / name)
    trimesh.PointCloud(np.random.default_rng(0).random((9, 3))).export(tmp_path / "points.ply")
    with pytest.raises(InputError, match="no triangles; make a surface"):
        read_scene_mesh(tmp_path / "points.ply")
    (tmp_path / "nan.obj").write_text("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"nan\.obj has vertices that are not numbers"):
        read_scene_mesh(tmp_path / "nan.obj")


@pytest.mark.parametrize(("suffix", "number"), [(".ply", "99"), (".ply", "-1"), (".obj", "99")])
def test_faces_of_vertices_that_a_file_lacks(tmp_path, suffix, number):
    file = tall(tmp_path / f"scene{suffix}", **{"encoding": "ascii"} if suffix == ".ply" else {})
    lines = file.read_text().rstrip().splitlines()
    file.write_text("\n".join([*lines[:-1], lines[-1].rsplit(" ", 1)[0] + f" {number}", ""]))
    with pytest.raises(InputError, match=r"scene\.\w+") as raised:
        read_scene_mesh(file)
    assert "\n" not in str(raised.value)


def gltf(path, **changes):
    """A box as glTF with its numbers in a file beside it."""
    files = tall_box().export(file_type="gltf")
    header = json.loads(files.pop("model.gltf")) | changes
    for name, content in files.items():
        (path.parent / name).write_bytes(content)
    if "uri" in changes:
        for buffer in header["buffers"]:
            buffer["uri"] = changes["uri"]
    path.write_text(json.dumps(header))
    return path


def tall_box():
    return trimesh.Scene(trimesh.creation.box((0.1, 0.3, 0.2)))


def test_gltf_with_its_numbers_beside_it(tmp_path):
    mesh, _ = read_scene_mesh(gltf(tmp_path / "scene.gltf"))
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [0.1, 0.2, 0.3], atol=1e-6)
    os.mkfifo(tmp_path / "pipe.bin")
    (tmp_path / "link.bin").symlink_to("/dev/zero")
    for uri in ("pipe.bin", "link.bin", "/etc/hostname", "../other.bin", "none.bin"):
        with pytest.raises(InputError, match=rf"numbers in '{uri}', which is no plain file"):
            read_scene_mesh(gltf(tmp_path / "scene.gltf", uri=uri))
    pictures = [{"uri": "none.png"}]  # not read
    read_scene_mesh(gltf(tmp_path / "scene.gltf", images=pictures))


@pytest.mark.parametrize("name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression"])
def test_compressed_gltf(tmp_path, name):
    file = gltf(tmp_path / "scene.gltf", extensionsRequired=[name])
    with pytest.raises(InputError, match=f"needs {name}; export without Draco"):
        read_scene_mesh(file)


def test_gltf_of_two_objects_one_of_which_has_faces_of_the_other(tmp_path):
    scene = tall_box()
    scene.add_geometry(trimesh.creation.box((0.1, 0.1, 0.1)))
    next(iter(scene.geometry.values())).faces[-1, 0] = 9
    scene.export(tmp_path / "two.glb")
    with pytest.raises(InputError, match=r"faces of vertices 0 to 9, but 8 vertices"):
        read_scene_mesh(tmp_path / "two.glb")
