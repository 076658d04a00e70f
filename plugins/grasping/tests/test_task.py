import json

import numpy as np
import pytest
from PIL import Image
from plugins.grasping.tests.boxes import grasping
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.tasks.test_predict import save

from scenefw.core.geometry import rigid, rotation_from_quaternion
from scenefw.core.types import GridSpec
from scenefw.tasks.predict import Predict
from scenefw_grasping.grasps import Ranking
from scenefw_grasping.report import films
from scenefw_grasping.task import Grasp
from scenefw_simulators.body_maker import BodyMaker

pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")


def task(image, output, chosen):
    pipeline = pipeline_of(KnownBoxes(GridSpec(resolution=32)), samples=1)
    return Grasp(Predict(image, pipeline, output, hypotheses=False), chosen, BodyMaker())


def matrix(pose):
    return rigid(rotation_from_quaternion(pose["quaternion"]), pose["position"])


def test_an_image_gets_ranked_grasps_a_picture_and_a_film(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(films, "_SIZE", (66, 54))
    image = save(tmp_path / "view.npz")
    figures = task(image, tmp_path / "out", grasping()).run()
    folder = tmp_path / "out" / "view"
    found = json.loads((folder / "grasps.json").read_text())
    assert figures["grasps_per_image"] == len(found["grasps"]) > 0
    assert found["reason"] is None
    camera = np.array(found["T_floor_camera"])
    for one in found["grasps"]:
        pose = matrix(one["floor"])
        np.testing.assert_allclose(camera @ matrix(one["camera"]), pose, atol=1e-6)
        for along, seen in zip(
            one["floor"]["taken_along"], one["camera"]["taken_along"], strict=True
        ):
            np.testing.assert_allclose(camera[:3, :3] @ seen, along, atol=1e-9)
    first = found["grasps"][0]
    assert first["object"] == 2  # it lies on the other
    assert first["lifted"]
    assert first["disturbance"] < 2e-3
    assert 0.12 < first["floor"]["position"][2] < 0.22
    assert [row["id"] for row in first["moved"]] == [1]
    with Image.open(folder / "grasp.gif") as film:
        assert film.n_frames > 5
    assert (folder / "grasps.png").is_file()
    assert (folder / "scene.json").is_file()
    said = capsys.readouterr().out
    assert "Grasps by predicted disturbance" in said
    assert said.splitlines()[-1] == str(folder / "grasps.json")


def test_without_a_grasp_the_list_is_empty_and_says_why(tmp_path, capsys):
    class Nothing:
        def rank(self, objects, eye, obstacles=()):
            return Ranking((), dict.fromkeys(objects, "it is too heavy"), objects)

    image = save(tmp_path / "view.npz")
    figures = task(image, tmp_path / "out", Nothing()).run()
    assert figures["grasps_per_image"] == 0
    found = json.loads((tmp_path / "out" / "view" / "grasps.json").read_text())
    assert found["grasps"] == []
    assert found["reason"] == "object 1: it is too heavy; object 2: it is too heavy"
    assert not (tmp_path / "out" / "view" / "grasp.gif").exists()
    assert "view: no grasp: object 1: it is too heavy" in capsys.readouterr().out


def test_command_line_refuses_an_engine_without_the_arm(tmp_path, scenefw):
    save(tmp_path / "view.npz")
    done = scenefw("run=grasp", "input=view.npz", "engine=mujoco", "paths.output=out")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert "engine=pybullet" in line
    assert not (tmp_path / "out").exists()
