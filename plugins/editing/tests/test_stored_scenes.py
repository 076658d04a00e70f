import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from tests.unit.perception.edited_scenes import CAMERA, scene

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec, Obstacle, PlacedShape, Pose, TriangleMesh
from scenefw.export.scene_folder import write_scene_files
from scenefw.export.superquadrics import Superquadrics
from scenefw.report.palette import colours_of
from scenefw.shapes.vessel import Vessel
from scenefw_editing.scene_editing import removed, scaled, with_objects
from scenefw_editing.stored_scenes import read_scene


@pytest.fixture(scope="module")
def known():
    return scene()


@pytest.fixture
def folder(known, tmp_path):
    write_scene_files(tmp_path, known, colours_of(known))
    return tmp_path


def change(folder, change):
    path = folder / "scene.json"
    told = json.loads(path.read_text())
    change(told)
    path.write_text(json.dumps(told))


def test_a_stored_scene_is_read_as_it_was(known, folder):
    found = read_scene(folder)
    assert found.frame.name == "blocks"
    np.testing.assert_array_equal(found.masks, known.masks)
    np.testing.assert_allclose(found.frame.camera.T_world_camera, CAMERA.T_world_camera)
    assert found.details["warnings"] == ["a line"]
    for now, was in zip(found.objects, known.objects, strict=True):
        assert (now.id, now.confidence) == (was.id, was.confidence)
        np.testing.assert_allclose(now.mesh.vertices, was.mesh.vertices, atol=1e-6)
        np.testing.assert_array_equal(now.mesh.faces, was.mesh.faces)
        np.testing.assert_allclose(now.pose.matrix, was.pose.matrix, atol=1e-12)
        assert (now.placed is None) == (was.placed is None)
        if was.placed:
            np.testing.assert_allclose(now.placed.shape.exponents, was.placed.shape.exponents)
    finer = found.grid.resolution == 64  # no grid is told in these details
    assert finer
    assert set(np.unique(found.instances)) == {0, 1, 2, 3}


def test_obstacles_are_stored_open_and_stay_in_edits(known, tmp_path):
    sheet = TriangleMesh(
        np.array([[0.5, -1.0, 0.0], [0.5, 1.0, 0.0], [0.5, 0.0, 1.0]]), np.array([[0, 1, 2]])
    )
    scene = replace(known, obstacles=(Obstacle("wall", sheet), Obstacle("robot", sheet)))
    write_scene_files(tmp_path, scene, colours_of(scene))
    found = read_scene(tmp_path)
    assert [obstacle.kind for obstacle in found.obstacles] == ["wall", "robot"]
    np.testing.assert_allclose(found.obstacles[0].mesh.vertices, sheet.vertices, atol=1e-6)
    assert "obstacles" not in found.details
    edited = with_objects(found, removed(found.objects, found.objects[0].id))
    assert edited.obstacles == found.obstacles
    change(tmp_path, lambda told: told["obstacles"][0].update(mesh="../elsewhere.ply"))
    with pytest.raises(InputError, match=r"an obstacle of .* expected NAME\.ply there"):
        read_scene(tmp_path)


def test_a_vessel_is_stored_by_its_numbers_and_scaled(known, tmp_path):
    vessel = Vessel(0.04, 0.8, 0.7, 0.1, 0.004)
    placed = PlacedShape(vessel, Pose(np.array([0.1, 0.2, 0.05]), np.array([1.0, 0, 0, 0])))
    first = replace(known.objects[0], mesh=placed.mesh(), placed=placed)
    write_scene_files(tmp_path, replace(known, objects=(first,)), colours_of(known)[:1])
    read = read_scene(tmp_path)
    assert vars(read.objects[0].placed.shape)["curve"] == 0.7
    np.testing.assert_allclose(
        read.objects[0].placed.mesh().vertices, placed.mesh().vertices, atol=1e-9
    )
    voxels = (read.instances == first.id).sum() * read.grid.voxel_size**3
    outside = np.pi * (0.04 * 0.9) ** 2 * 0.1  # about: walls alone would be a sixth
    assert voxels == pytest.approx(outside, rel=0.25)
    larger = scaled(read.objects, first.id, 2.0)[0]
    assert larger.placed.shape.radius == pytest.approx(0.08)
    np.testing.assert_allclose(
        np.ptp(larger.placed.mesh().vertices, axis=0), np.ptp(larger.mesh.vertices, axis=0),
        atol=1e-3,
    )  # fmt: skip
    Superquadrics().write(tmp_path / "s.json", read, [])
    told = json.loads((tmp_path / "s.json").read_text())
    assert told == {"superquadrics": [], "unexplained": [first.id]}


def test_an_impossible_vessel_is_told_with_its_file(known, tmp_path):
    vessel = Vessel(0.04, 0.8, 0.7, 0.1, 0.004)
    placed = PlacedShape(vessel, Pose(np.array([0.1, 0.2, 0.05]), np.array([1.0, 0, 0, 0])))
    first = replace(known.objects[0], mesh=placed.mesh(), placed=placed)
    write_scene_files(tmp_path, replace(known, objects=(first,)), colours_of(known)[:1])
    change(tmp_path, lambda told: told["objects"][0]["shape"].update(wall=-1.0))
    with pytest.raises(InputError, match=r"scene\.json"):
        read_scene(tmp_path)


def test_the_file_alone_will_do_where_shapes_are_told(known, folder):
    def forget(told):
        told["objects"] = told["objects"][:2]
        for item in told["objects"]:
            item["mesh"] = None

    change(folder, forget)
    found = read_scene(folder / "scene.json")
    for now, was in zip(found.objects, known.objects, strict=False):
        np.testing.assert_allclose(now.mesh.vertices, was.mesh.vertices, atol=1e-9)


def set_pose(row, column, value):
    return lambda told: told["camera"]["T_world_camera"][row].__setitem__(column, value)


def set_item(number, key, value):
    return lambda told: told["objects"][number].update({key: value})


def test_a_shape_of_a_plugin_is_read_as_its_mesh(known, folder):
    torus = {"kind": "torus", "radius": 0.1, "position": [0, 0, 0], "quaternion": [1, 0, 0, 0]}
    change(folder, set_item(0, "shape", torus))
    with pytest.warns(
        UserWarning, match=r"^object 1 of .* kind 'torus', which isn't known"
    ) as told:
        found = read_scene(folder)
    assert len(told) == 1
    assert "\n" not in str(told[0].message)
    first, *others = found.objects
    assert first.placed is None
    np.testing.assert_allclose(first.mesh.vertices, known.objects[0].mesh.vertices, atol=1e-6)
    assert [one.placed is None for one in others] == [
        one.placed is None for one in known.objects[1:]
    ]
    change(folder, set_item(0, "mesh", None))
    with pytest.raises(InputError, match=r"object 1 of .* has neither a mesh file nor a shape of"):
        read_scene(folder)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (set_item(2, "mesh", None), "object 3 of .* has neither a mesh file nor a shape"),
        (set_item(2, "mesh", "../object_03.ply"), "expected NAME.ply there"),
        (set_item(2, "mesh", "/etc/passwd"), "expected NAME.ply there"),
        (set_item(2, "mesh", "gone.ply"), "there is no .*gone.ply, the mesh of object 3"),
        (set_item(2, "mesh", "bad.ply"), "bad.ply"),
        (set_item(2, "id", 1), r"objects \[1, 2, 1\]; expected different ids"),
        (set_item(2, "id", 10**9), "expected different ids"),
        (set_item(2, "id", "x"), "isn't a scenefw scene, or damaged"),
        (set_item(2, "extents", [1, 2]), "are not 3 numbers"),
        (set_item(2, "pose", {"position": [0, 0, 0], "quaternion": [9, 0, 0, 0]}), "length 1"),
        (set_item(0, "shape", {"kind": "superquadric"}), "half_axes"),
        (lambda told: told.pop("camera"), "lacks name, objects or camera"),
        (set_item(0, "shape", {"radius": 1}), "isn't a scenefw scene, or damaged"),
        (lambda told: told["camera"].update(width=0), "0 x 48 pixels"),
        (lambda told: told["camera"].update(fx=float("nan")), "the camera has fx, fy, cx, cy"),
        (lambda told: told["camera"].update(fy=-5.0), "the camera has fx, fy, cx, cy"),
        (set_pose(2, 3, float("nan")), "no rigid 4 x 4 matrix"),
        (set_pose(3, 0, 1.0), "no rigid 4 x 4 matrix"),
        (lambda told: told.update(grid={"resolution": 10**6}), "voxels per side"),
        (lambda told: told.update(objects=3), "isn't a scenefw scene, or damaged"),
    ],
)
def test_damaged_scenes_are_refused_in_one_line(folder, damage, said):
    (folder / "bad.ply").write_bytes(b"ply\nnonsense")
    change(folder, damage)
    with pytest.raises(InputError, match=said) as error:
        read_scene(folder)
    assert "\n" not in str(error.value)


def test_files_that_are_no_scene(tmp_path):
    with pytest.raises(InputError, match=r"there is no .*scene\.json"):
        read_scene(tmp_path)
    other = tmp_path / "other.json"
    for text, said in (
        ("{", "can't be read as JSON"),
        ("[1]", "lacks name"),
        ("[" * 10**5, "JSON"),
    ):
        other.write_text(text)
        with pytest.raises(InputError, match=said):
            read_scene(other)


def test_the_grid_comes_back_whole(known, tmp_path):
    """Edited scenes have it among their details; its truncation decides what their volumes hold."""
    grid = replace(known.grid, truncation_voxels=3.5)
    changed = replace(known, grid=grid, details={**known.details, "grid": asdict(grid)})
    write_scene_files(tmp_path, changed, colours_of(known))
    assert read_scene(tmp_path).grid == grid
    edited = with_objects(changed, removed(changed.objects, 3))
    assert GridSpec(**edited.details["grid"]) == edited.grid
    assert edited.grid.truncation_voxels == 3.5
