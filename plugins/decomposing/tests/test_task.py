"""`run=decompose`: a mesh or a recording to a folder of objects, or one clear line."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from plugins.decomposing.tests.several import PAIR, TABLE, boxes, fitted_parts
from plugins.decomposing.tests.test_views_observer import frames

from scenefw.core import geometry
from scenefw.core.errors import ConfigError, InputError, StorageError
from scenefw.core.types import GridSpec
from scenefw.data.files.sequences import write_sequence
from scenefw.export.meshes import write_ply
from scenefw_decomposing.mesh_views import MeshViews
from scenefw_decomposing.surround import SurroundingCameras
from scenefw_decomposing.task import Decompose
from scenefw_simulators.urdf import URDF


def task(path, output, **settings):
    pipeline = fitted_parts(grid=GridSpec(resolution=48))
    meshes = MeshViews(SurroundingCameras(240, 180, ring=4))
    return Decompose(path, pipeline, meshes, output, **settings)


def names(folder):
    return sorted(path.name for path in folder.glob("[!.]*"))


def sizes(summary):
    return sorted(sorted(item["extents"]) for item in summary["objects"])


def test_a_mesh_is_taken_apart_and_labelled(tmp_path):
    T = geometry.rigid(np.eye(3), (0.3, 0.2, 0.75))  # noqa: N806
    mesh = boxes(*PAIR, table=TABLE)
    vertices = geometry.transform_points(T, mesh.vertices)
    write_ply(tmp_path / "pair.ply", type(mesh)(vertices, mesh.faces))
    figures = task(tmp_path / "pair.ply", tmp_path / "out", exports={"urdf": URDF()}).run()
    assert figures["objects"] == 2
    assert figures["views"] == 5
    folder = tmp_path / "out" / "pair"
    wanted = {"labelled.ply", "masks.png", "object_01.ply", "object_02.ply", "overview.png"}
    assert wanted | {"scene.glb", "scene.html", "scene.json", "scene.urdf"} <= set(names(folder))
    summary = json.loads((folder / "scene.json").read_text())
    assert summary["name"] == "pair"
    np.testing.assert_allclose(sizes(summary), [[0.08, 0.1, 0.12], [0.1, 0.14, 0.2]], atol=0.008)
    # where the file's boxes are, in the coordinates of the result
    to_result = np.array(summary["T_world_input"])
    for item in summary["objects"]:
        places = [geometry.transform_points(to_result @ T, place) for _, place in PAIR]
        assert min(np.linalg.norm(np.subtract(places, item["centre"]), axis=1)) < 0.006
    _each_box_has_a_colour(folder, mesh)


def _each_box_has_a_colour(folder, mesh):
    labelled = trimesh.load(folder / "labelled.ply", process=False)
    colours = labelled.visual.vertex_colors[:, :3]
    assert len(colours) == len(mesh.vertices)
    count = len(boxes(PAIR[0]).vertices)
    high = mesh.vertices[:, 2] > 0.02  # what is lower may be the table's
    found = [np.unique(colours[:count][high[:count]], axis=0)]
    found.append(
        np.unique(colours[count : 2 * count][mesh.vertices[count : 2 * count, 2] > 0.12], axis=0)
    )
    beside = np.abs(mesh.vertices[2 * count :, 0]) > 0.15
    table = np.unique(colours[2 * count :][beside], axis=0)
    assert [len(one) for one in (*found, table)] == [1, 1, 1]
    assert len({tuple(one[0]) for one in (*found, table)}) == 3


def test_a_recording_is_taken_apart(tmp_path, capsys):
    write_sequence(tmp_path / "walk.2", frames())
    figures = task(tmp_path / "walk.2", tmp_path / "out", overview=False, page=False).run()
    assert (figures["objects"], figures["views"]) == (2, 4)
    folder = tmp_path / "out" / "walk.2"
    assert names(folder) == [
        "masks.png", "object_01.ply", "object_02.ply", "scene.glb", "scene.json",
    ]  # fmt: skip
    summary = json.loads((folder / "scene.json").read_text())
    assert summary["views"] == [f"{number:06d}" for number in range(4)]
    # its height is hidden where it stands on the other
    np.testing.assert_allclose(sizes(summary)[0], [0.08, 0.1, 0.11], atol=0.02)
    assert str(folder) in capsys.readouterr().out.splitlines()


def test_empty_frames_are_skipped_with_a_word(tmp_path, capsys):
    """Further views take their place; without any measurement there is nothing to take apart."""
    views = frames()
    blind = [replace(frame, depth=np.zeros_like(frame.depth)) for frame in views]
    write_sequence(tmp_path / "walk", [blind[0], *views[1:]])
    plain = {"overview": False, "page": False}
    figures = task(tmp_path / "walk", tmp_path / "out", max_views=3, **plain).run()
    assert figures["views"] == 3
    assert "skipped frames without a measurement: 0" in capsys.readouterr().err
    write_sequence(tmp_path / "blind", blind)
    with pytest.raises(InputError, match="no frame holds a measurement"):
        task(tmp_path / "blind", tmp_path / "out", **plain).run()


def test_bad_input(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(ConfigError, match=r"run=decompose needs input=PATH"):
        task(None, out)
    with pytest.raises(ConfigError, match="mesh_scale"):
        task(tmp_path / "a.ply", out, mesh_scale=0.0)
    with pytest.raises(InputError, match=r"no file or folder .*none\.ply"):
        task(tmp_path / "none.ply", out).run()
    (tmp_path / "view.npz").write_bytes(b"")
    with pytest.raises(InputError, match=r"view\.npz is no mesh; one depth image .* run=predict"):
        task(tmp_path / "view.npz", out).run()
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"expected depth/"):
        task(tmp_path / "empty", out).run()
    assert not out.exists() or not names(out)


def test_a_recording_is_not_replaced_by_its_result(tmp_path):
    """Even if scenefw wrote it, so that it may replace what is there."""
    write_sequence(tmp_path / "walk", frames())
    with pytest.raises(ConfigError, match="is the folder of the input"):
        task(tmp_path / "walk", tmp_path)
    assert (tmp_path / "walk" / "poses.txt").is_file()


class Lifted:
    """Settles objects half a metre higher."""

    def settle(self, scenes):
        (scene,) = scenes
        up = np.array([0.0, 0.0, 0.5])
        objects = tuple(
            replace(item, mesh=replace(item.mesh, vertices=item.mesh.vertices + up))
            for item in scene.objects
        )
        settled = {"displacement": 0.5, "stable": True, "objects": []}
        return [replace(scene, objects=objects, details={**scene.details, "settled": settled})]


@pytest.mark.exhaustive
def test_a_mesh_is_labelled_where_it_was_scanned(tmp_path, monkeypatch):
    monkeypatch.setattr("scenefw_decomposing.task.settled_words", lambda scene: "lifted")
    mesh = boxes(*PAIR, table=TABLE)
    write_ply(tmp_path / "pair.ply", mesh)
    task(tmp_path / "pair.ply", tmp_path / "out", settling=Lifted(), page=False).run()
    _each_box_has_a_colour(tmp_path / "out" / "pair", mesh)


@pytest.mark.exhaustive
def test_a_gltf_file_keeps_its_own_coordinates(tmp_path):
    """T_world_input begins with the numbers of the file, whose y is up."""
    mesh = boxes(*PAIR, table=TABLE)
    turned = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    down = trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])
    turned.apply_transform(down).export(tmp_path / "pair.glb")
    task(tmp_path / "pair.glb", tmp_path / "out", overview=False, page=False).run()
    summary = json.loads((tmp_path / "out" / "pair" / "scene.json").read_text())
    to_result = np.array(summary["T_world_input"]) @ down
    places = [geometry.transform_points(to_result, place) for _, place in PAIR]
    for item in summary["objects"]:
        assert min(np.linalg.norm(np.subtract(places, item["centre"]), axis=1)) < 0.006


def test_foreign_folders_stay(tmp_path):
    write_ply(tmp_path / "pair.ply", boxes(*PAIR))
    (tmp_path / "out" / "pair").mkdir(parents=True)
    (tmp_path / "out" / "pair" / "notes.txt").write_text("mine")
    with pytest.raises(StorageError, match="pair"):
        task(tmp_path / "pair.ply", tmp_path / "out").run()
    assert names(tmp_path / "out" / "pair") == ["notes.txt"]
