import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from tests.unit.perception.edited_scenes import scene

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import rigid
from scenefw.export.scene_files import OBJ
from scenefw.export.scene_folder import write_scene_files
from scenefw.perception.estimate.transforms import moved
from scenefw.report.palette import colours_of
from scenefw_editing.stored_scenes import read_scene
from scenefw_editing.task import Edit


class Falling:
    """Stands for a simulation: object 2 falls 10 cm."""

    def settle(self, scenes):
        down = rigid(np.eye(3), (0, 0, -0.1))
        row = {"id": 2, "moved": 0.1, "turned": 0.0}
        return [
            replace(moved(one, {2: down}), details={**one.details, "settled": {"objects": [row]}})
            for one in scenes
        ]


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blocks")
    write_scene_files(folder, scene(), colours_of(scene()))
    return folder


def test_an_edited_scene_is_written_like_a_prediction(stored, tmp_path, capsys):
    edits = ["remove 3", "move 2 0.0 0.0 0.05", "add superquadric 0.03 0.03 0.03 2 2 2 0.3 0"]
    figures = Edit(stored, edits, tmp_path, exports={"obj": OBJ()}).run()
    assert figures == {"objects": 3, "warnings": 1}
    told = capsys.readouterr()
    folder = tmp_path / "blocks_edited"
    assert told.out.splitlines()[-1] == str(folder)
    assert told.err == "warning: object 2 hovers 50 mm above object 1\n"
    made = {path.name for path in folder.iterdir()}
    assert made >= {"scene.json", "scene.glb", "scene.obj", "scene.html", "edited.png", "masks.png"}
    assert {name for name in made if name.endswith(".ply")} == {
        f"object_0{i}.ply" for i in (1, 2, 3)
    }
    assert len(trimesh.load(folder / "scene.glb").geometry) == 3
    summary = json.loads((folder / "scene.json").read_text())
    assert summary["edits"] == edits
    assert summary["warnings"] == ["object 2 hovers 50 mm above object 1"]
    again = read_scene(folder)
    assert [item.id for item in again.objects] == [1, 2, 3]
    assert set(np.unique(again.masks)) == {0, 1, 2}  # the new object 3 isn't the old one
    # and it can be edited again, in its own place
    Edit(folder, ["remove 3"], tmp_path, page=False, overview=False).run()
    assert [item.id for item in read_scene(folder).objects] == [1, 2]
    assert [path.name for path in tmp_path.iterdir()] == ["blocks_edited"]


def test_two_scenes_are_joined(stored, tmp_path):
    edits = [f"join {stored / 'scene.json'} 0 0.5 0", f"add {stored} 3 0 0 0.08"]
    Edit(stored, edits, tmp_path, page=False, overview=False).run()
    found = read_scene(tmp_path / "blocks_edited")
    assert [item.id for item in found.objects] == list(range(1, 8))
    assert found.details["warnings"] == []


def test_objects_may_come_to_rest(stored, tmp_path, capsys):
    Edit(stored, ["remove 1"], tmp_path, Falling(), page=False, overview=False).run()
    assert "settled: object 2 moved 10.0 cm" in capsys.readouterr().out
    found = read_scene(tmp_path / "blocks_edited")
    assert found.objects[0].mesh.vertices[:, 2].min() == pytest.approx(0, abs=1e-6)
    assert found.details["warnings"] == []
    assert found.details["settled"]["objects"][0]["id"] == 2


def test_without_edits_objects_are_listed_and_nothing_is_written(stored, tmp_path, capsys):
    assert Edit(stored, [], tmp_path / "none").run() == {"objects": 3}
    told = capsys.readouterr().out
    assert "20 × 16 × 10 cm" in told
    assert "remove ID; move ID DX DY DZ" in told
    assert not (tmp_path / "none").exists()


def test_a_shape_of_a_plugin_is_told_of_in_one_line(tmp_path, capsys):
    write_scene_files(tmp_path / "blocks", scene(), colours_of(scene()))
    path = tmp_path / "blocks" / "scene.json"
    path.write_text(path.read_text().replace('"superquadric"', '"torus"', 1))
    Edit(tmp_path / "blocks", ["remove 2"], tmp_path, page=False, overview=False).run()
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1
    assert told[0].startswith(f"warning: object 1 of {path} has a shape of kind 'torus'")


def test_a_wrong_edit_leaves_nothing_half_done(stored, tmp_path):
    with pytest.raises(InputError, match="there is no object 3; the scene has 1, 2"):
        Edit(stored, ["remove 3", "move 3 0 0 0"], tmp_path / "out").run()
    assert not list((tmp_path / "out").iterdir())


def test_settings_are_checked():
    with pytest.raises(ConfigError, match="input=PATH"):
        Edit(None)
    with pytest.raises(ConfigError, match="tolerance"):
        Edit("x", tolerance=-1)


def test_from_the_command_line(scenefw, stored):
    done = scenefw(
        "run=edit", f"input={stored}", "run.edits=[remove 1, turn 2 90]", "settling=physics",
        "engine=mujoco", "paths.output=out", "run.page=false",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].endswith(("blocks_edited", "out"))
    assert "object 2 moved 10.0 cm" in done.stdout
