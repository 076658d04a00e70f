"""Scenes drawn from a prior, as folders that edits and viewers read."""

import json

import numpy as np
import pytest
import torch
from PIL import Image
from plugins.scene_prior.tests.test_prior import GRID, HALF, Loaded, Told

from scenefw.core.errors import ConfigError
from scenefw.export.scene_files import OBJ
from scenefw.learning.checkpoint import save_checkpoint
from scenefw_editing.stored_scenes import read_scene
from scenefw_scene_prior.network import SetFlow
from scenefw_scene_prior.prior import ScenePrior
from scenefw_scene_prior.sampler import Sampler
from scenefw_scene_prior.task import DrawScenes

SCENES = [[(0.0, 0.0, HALF), (0.0, 0.2, HALF)]]


@pytest.fixture
def prior():
    return ScenePrior(Loaded(Told(SCENES)), GRID)


def test_each_scene_gets_a_folder_and_all_a_picture_and_a_page(prior, tmp_path, capsys):
    figures = DrawScenes(prior, 5, tmp_path, {"obj": OBJ()}).run()
    assert figures == {"scenes": 5, "draws_per_scene": 1, "objects_per_scene": 2}
    folder = tmp_path / "drawn"
    assert capsys.readouterr().out.splitlines()[-1] == str(folder)
    made = {path.name for path in folder.glob("[!.]*")}
    assert made == {"drawn.png", "drawn.html", *(f"scene_00{i}" for i in range(1, 6))}
    assert (folder / "scene_003" / "scene.obj").is_file()
    again = read_scene(folder / "scene_002")
    assert np.allclose([item.pose.position for item in again.objects], SCENES[0], atol=1e-3)
    with Image.open(folder / "drawn.png") as picture:
        assert np.asarray(picture).std() > 5
    told = json.loads((folder / "scene_004" / "scene.json").read_text())
    assert told["name"] == "scene_004"
    assert told["drawn"]["number"] == 4
    assert "scene_005" in (folder / "drawn.html").read_text()


def test_from_python(prior):
    first, second = Sampler(prior).draw(2, seed=3)
    assert first.ids == second.ids == [1, 2]


def test_nothing_to_draw_is_told(prior):
    with pytest.raises(ConfigError, match=r"run\.count is 0"):
        DrawScenes(prior, 0)


@pytest.mark.exhaustive
def test_from_the_command_line(scenefw, tmp_path):
    torch.manual_seed(0)
    model = SetFlow(slots=4, width=16, layers=1, view_layers=1, heads=2)
    save_checkpoint(tmp_path / "flow.safetensors", model, model.recipe, None, task="set_flow")
    words = ("run=draw_scenes", "~settling", f"paths.output={tmp_path / 'out'}", "run.count=2")
    done = scenefw(*words, f"checkpoints.set_flow={tmp_path / 'flow.safetensors'}")
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "out" / "drawn" / "scene_002" / "scene.json").is_file()
    missing = scenefw(*words, f"checkpoints.set_flow={tmp_path / 'none.safetensors'}")
    assert missing.returncode == 2
    assert "none.safetensors" in missing.stderr.splitlines()[-1]
